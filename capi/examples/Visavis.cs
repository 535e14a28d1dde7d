// P/Invoke declarations of visavis.h, and a small wrapper that shows their use, for Unity and .NET.
// Not tested in Unity or .NET: tests/layout.rs compares names, numbers and layouts with the header.
//
// Put libvisavis_c.so (Android, Linux), visavis_c.dll or libvisavis_c.dylib into Assets/Plugins and the bundle into StreamingAssets. On Android
// StreamingAssets lie inside the APK: read them with UnityWebRequest and pass the bytes to Engine.FromBytes.
using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Visavis
{
    public enum Status
    {
        Ok = 0,
        Argument = 1,
        Io = 2,
        BundleCorrupt = 3,
        BundleVersion = 4,
        BundleInvalid = 5,
        Audio = 6,
        State = 7,
        CpuLevel = 8,
        Busy = 9,
        Abi = 10,
        Panic = 11,
        Other = 12,
    }

    /// The voice of a push or a command: visavis_voice.
    public enum Speaker
    {
        Agent = 0,
        User = 1,
    }

    public enum SamplerKind
    {
        Midpoint = 0,
        Euler = 1,
        Single = 2,
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct SessionOptions
    {
        public uint StructSize, Threads;
        public ulong Seed, CoreMask;
        public int SamplerKind;
        public uint SamplerSteps;
        public float Gaze, Guidance, GazeGuidance, Temperature;
        public double StartX, StartZ, StartYaw;
        public uint Stance, Guard;
        public float BudgetMs;
        public uint Reserved;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Frame
    {
        public ulong Index;
        public double Time, RootX, RootZ, RootYaw;
        public float HipsX, HipsY, HipsZ, FitError, Gaze;
        public int SamplerKind;
        public uint SamplerSteps;
        public float Held;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Joint
    {
        public float LocalX, LocalY, LocalZ, LocalW;
        public float PositionX, PositionY, PositionZ;
        public float RotationX, RotationY, RotationZ, RotationW;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct VoiceStats
    {
        public ulong UnderrunSamples, OverflowSamples, ClippedSamples;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Stats
    {
        public uint StructSize, Reserved;
        public ulong Blocks;
        public double BlockMsP50, BlockMsP95, BlockMsP99, BlockMsMax, UserDelayMs, AgentDelayMs;
        public ulong Anchorings, CacheBytes;
        public VoiceStats AgentVoice, UserVoice;
        public ulong HeadAccepted, HeadNonFinite, HeadOutOfOrder, HeadAbsurd, HeadTeleports, HeadOverwritten;
        public ulong GovernorMissed, GovernorDown, GovernorUp, GovernorHeldBlocks, GovernorCatchUpPasses, GuardTrips, GuardHeldFrames;
        public ulong AgentNonFiniteSamples, AgentBadRateSamples, AgentContendedSamples;
        public ulong UserNonFiniteSamples, UserBadRateSamples, UserContendedSamples;
    }

    internal static class Native
    {
        const string Library = "visavis_c";
        public const uint AbiVersion = 0x10001;

        [DllImport(Library)] public static extern uint visavis_abi_version();
        [DllImport(Library)] public static extern Status visavis_check_abi(uint abiVersion);
        [DllImport(Library)] public static extern IntPtr visavis_version();
        [DllImport(Library)] public static extern IntPtr visavis_last_error();
        [DllImport(Library)] public static extern uint visavis_current_thread_id();
        [DllImport(Library)] public static extern Status visavis_pin_current_thread(ulong mask);
        [DllImport(Library)] public static extern Status visavis_engine_from_path(byte[] utf8Path, out IntPtr engine);
        [DllImport(Library)] public static extern Status visavis_engine_from_fd(int fd, ulong offset, ulong length, out IntPtr engine);
        [DllImport(Library)] public static extern Status visavis_engine_from_memory(byte[] bytes, UIntPtr length, out IntPtr engine);
        [DllImport(Library)] public static extern void visavis_engine_free(IntPtr engine);
        [DllImport(Library)] public static extern IntPtr visavis_engine_name(IntPtr engine);
        [DllImport(Library)] public static extern uint visavis_engine_joint_count(IntPtr engine);
        [DllImport(Library)] public static extern IntPtr visavis_engine_joint_name(IntPtr engine, uint joint);
        [DllImport(Library)] public static extern Status visavis_engine_joint(IntPtr engine, uint joint, out int parent, [Out] float[] offset);
        [DllImport(Library)] public static extern int visavis_engine_openxr_joint(IntPtr engine, uint joint, int body);
        [DllImport(Library)] public static extern int visavis_engine_joint_for_openxr(IntPtr engine, uint openXrJoint);
        [DllImport(Library)] public static extern Status visavis_session_options_init(out SessionOptions options, UIntPtr structSize);
        [DllImport(Library)] public static extern Status visavis_session_new(IntPtr engine, ref SessionOptions options, out IntPtr session);
        [DllImport(Library)] public static extern void visavis_session_free(IntPtr session);
        [DllImport(Library)] public static extern Status visavis_session_push_agent_audio(IntPtr session, float[] samples, UIntPtr count, uint rate);
        [DllImport(Library)] public static extern Status visavis_session_push_user_audio(IntPtr session, float[] samples, UIntPtr count, uint rate);
        [DllImport(Library)] public static extern Status visavis_session_finish_audio(IntPtr session, int voice);
        [DllImport(Library)] public static extern Status visavis_session_clear_audio(IntPtr session, int voice);
        [DllImport(Library)] public static extern Status visavis_session_set_audio_present(IntPtr session, int voice, int present);
        [DllImport(Library)] public static extern Status visavis_session_push_user_head(IntPtr session, float x, float y, float z, double time);
        [DllImport(Library)] public static extern Status visavis_session_push_user_pose(IntPtr session, float x, float y, float z, float qx, float qy, float qz, float qw, double time);
        [DllImport(Library)] public static extern Status visavis_session_dyadic(IntPtr session, [Out] float[] shares, UIntPtr capacity, out UIntPtr count);
        [DllImport(Library)] public static extern Status visavis_session_set_gaze(IntPtr session, float target);
        [DllImport(Library)] public static extern Status visavis_session_set_natural_gaze(IntPtr session);
        [DllImport(Library)] public static extern Status visavis_session_set_guidance(IntPtr session, float weight, float gaze);
        [DllImport(Library)] public static extern Status visavis_session_set_sampler(IntPtr session, int kind, uint steps);
        [DllImport(Library)] public static extern Status visavis_session_set_budget(IntPtr session, float milliseconds);
        [DllImport(Library)] public static extern Status visavis_session_report_block_time(IntPtr session, double milliseconds);
        [DllImport(Library)] public static extern Status visavis_session_poll(IntPtr session, double now, [Out] Frame[] frames, UIntPtr frameSize, [Out] Joint[] joints, UIntPtr jointCapacity, out uint frameCount);
        [DllImport(Library)] public static extern Status visavis_session_next_due(IntPtr session, out double time);
        [DllImport(Library)] public static extern Status visavis_session_reset(IntPtr session);
        [DllImport(Library)] public static extern Status visavis_session_warm_up(IntPtr session, uint blocks);
        [DllImport(Library)] public static extern Status visavis_session_worker_thread_ids(IntPtr session, [Out] uint[] ids, UIntPtr capacity, out UIntPtr count);
        [DllImport(Library)] public static extern Status visavis_session_stats(IntPtr session, ref Stats stats);
    }

    /// A loaded bundle. Shared by any number of sessions.
    public sealed class Engine : IDisposable
    {
        IntPtr handle;

        Engine(IntPtr handle) { this.handle = handle; }

        public static Engine FromBytes(byte[] bundle)
        {
            Check(Native.visavis_check_abi(Native.AbiVersion));
            Check(Native.visavis_engine_from_memory(bundle, (UIntPtr)bundle.Length, out var handle));
            return new Engine(handle);
        }

        public static Engine FromPath(string path)
        {
            Check(Native.visavis_check_abi(Native.AbiVersion));
            Check(Native.visavis_engine_from_path(Encoding.UTF8.GetBytes(path + "\0"), out var handle));
            return new Engine(handle);
        }

        public int JointCount => (int)Native.visavis_engine_joint_count(handle);

        public string JointName(int joint) => Marshal.PtrToStringAnsi(Native.visavis_engine_joint_name(handle, (uint)joint));

        public Session NewSession(float? gaze = null)
        {
            Check(Native.visavis_session_options_init(out var options, (UIntPtr)Marshal.SizeOf<SessionOptions>()));
            if (gaze.HasValue) options.Gaze = gaze.Value;
            Check(Native.visavis_session_new(handle, ref options, out var session));
            return new Session(session, JointCount);
        }

        public void Dispose()
        {
            Native.visavis_engine_free(handle);
            handle = IntPtr.Zero;
        }

        internal static void Check(Status status)
        {
            if (status == Status.Ok) return;
            throw new InvalidOperationException(status + ": " + Marshal.PtrToStringAnsi(Native.visavis_last_error()));
        }
    }

    /// One conversation. Coordinates are right-handed, Y up: for Unity negate Z of positions, and X and Y of quaternions.
    public sealed class Session : IDisposable
    {
        const int BlockFrames = 4;
        IntPtr handle;
        public readonly Frame[] Frames = new Frame[BlockFrames];
        /// Joint j of frame i is Joints[i * Engine.JointCount + j].
        public readonly Joint[] Joints;

        internal Session(IntPtr handle, int joints)
        {
            this.handle = handle;
            Joints = new Joint[BlockFrames * joints];
        }

        // Pushes, commands and settings: from any thread, such as OnAudioFilterRead of a microphone and the update of a tracker. They
        // never wait for Poll, and a block goes by what came before its Poll began. One thread pushes the sound of a voice.

        /// Appends samples; more than a minute ahead is dropped and counted. Samples that are not finite become
        /// silence, and are told by an exception after all others were taken.
        public void PushAudio(Speaker speaker, float[] samples, int rate)
        {
            var count = (UIntPtr)samples.Length;
            Engine.Check(speaker == Speaker.Agent
                ? Native.visavis_session_push_agent_audio(handle, samples, count, (uint)rate)
                : Native.visavis_session_push_user_audio(handle, samples, count, (uint)rate));
        }

        public void PushAgentAudio(float[] samples, int rate) => PushAudio(Speaker.Agent, samples, rate);

        public void PushUserAudio(float[] samples, int rate) => PushAudio(Speaker.User, samples, rate);

        /// Ends an utterance: the last milliseconds come out. Optional.
        public void FinishAudio(Speaker speaker) => Engine.Check(Native.visavis_session_finish_audio(handle, (int)speaker));

        /// Breaks an utterance off.
        public void ClearAudio(Speaker speaker) => Engine.Check(Native.visavis_session_clear_audio(handle, (int)speaker));

        /// Positions are put in order by time; those that are late are counted.
        public void PushUserHead(float x, float y, float z, double time) =>
            Engine.Check(Native.visavis_session_push_user_head(handle, x, y, z, time));

        /// The same with the head's rotation: a quaternion of about unit length, identity where the user faces +Z. Bundles of the kind `dram` look at it.
        public void PushUserPose(float x, float y, float z, float qx, float qy, float qz, float qw, double time) =>
            Engine.Check(Native.visavis_session_push_user_pose(handle, x, y, z, qx, qy, qz, qw, time));

        /// How much each joint of the last block's frames follows the user, 0 to 1, into room for Joints.Length numbers; how many those are, 0 with
        /// bundles of another kind than `dram`.
        public int Dyadic(float[] shares)
        {
            Engine.Check(Native.visavis_session_dyadic(handle, shares, (UIntPtr)shares.Length, out var count));
            return (int)count;
        }

        /// 0 averted, 1 sustained eye contact; null leaves it to the model.
        public void SetGaze(float? target) =>
            Engine.Check(target.HasValue ? Native.visavis_session_set_gaze(handle, target.Value) : Native.visavis_session_set_natural_gaze(handle));

        // What follows is one thread's at a time: Status.Busy otherwise.

        /// True when four frames have come; call it until it is false.
        public bool Poll(double now)
        {
            Engine.Check(Native.visavis_session_poll(handle, now, Frames, (UIntPtr)Marshal.SizeOf<Frame>(), Joints, (UIntPtr)Joints.Length, out var count));
            return count > 0;
        }

        public void Dispose()
        {
            Native.visavis_session_free(handle);
            handle = IntPtr.Zero;
        }
    }
}
