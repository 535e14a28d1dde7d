// Structs and numbers of visavis.h. capi/tests/layout.rs and Tests~/Layouts.cs compare names, numbers, sizes and offsets with the header.
using System.Runtime.InteropServices;

namespace Visavis
{
    /// <summary>What became of a call: visavis_status.</summary>
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

    /// <summary>The voice of a push or a command: visavis_voice.</summary>
    public enum Speaker
    {
        Agent = 0,
        User = 1,
    }

    /// <summary>How a block is made, evaluations against quality: visavis_sampler_kind.</summary>
    public enum SamplerKind
    {
        Midpoint = 0,
        Euler = 1,
        Single = 2,
    }

    /// <summary>What a session is made with: visavis_session_options, whose comments give units and ranges. NaN: the bundle's own value.</summary>
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
        public double VoiceAhead;
        public float Sensitivity;
        public uint Reserved2;
    }

    /// <summary>One frame without its joints, session world: visavis_frame.</summary>
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

    /// <summary>One joint of a frame, session world; quaternions x, y, z, w: visavis_joint.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Joint
    {
        public float LocalX, LocalY, LocalZ, LocalW;
        public float PositionX, PositionY, PositionZ;
        public float RotationX, RotationY, RotationZ, RotationW;
    }

    /// <summary>Counters of a voice, 24 kHz samples: visavis_voice_stats.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct VoiceStats
    {
        public ulong UnderrunSamples, OverflowSamples, ClippedSamples;
    }

    /// <summary>Statistics of a session: visavis_stats.</summary>
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
        public ulong GovernorFallbackBlocks;
        public ulong SoundPieces, SoundStarted, SoundOverflowSamples, SoundClippedSamples, SoundNonFiniteSamples, SoundBadRateSamples;
        public ulong SoundBadPlaces, SoundContendedSamples, SoundRefused, SoundReplaced;
    }
}
