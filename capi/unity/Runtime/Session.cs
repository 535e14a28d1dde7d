using System;
using System.Runtime.InteropServices;

namespace Visavis
{
    /// <summary>One conversation. Session world: metres, seconds, right-handed, Y up; times count from 0 at its start.</summary>
    /// <remarks>
    /// Pushes, commands and settings come from any thread, such as OnAudioFilterRead and a tracker's. They never wait for Poll or for each other and are never
    /// refused; a block goes by what came before its Poll began. One thread at a time pushes the sound of a voice or of a source. Poll, Reset, WarmUp, SetFallback and Statistics
    /// are one thread's at a time, else BusyException. After Dispose: ObjectDisposedException; a call under way ends first.
    /// </remarks>
    public sealed class Session : IDisposable
    {
        /// <summary>Frames of a block.</summary>
        public const int BlockFrames = 4;

        /// <summary>Frames a second.</summary>
        public const int Rate = 30;

        readonly SessionHandle handle;

        internal Session(SessionHandle handle, int joints)
        {
            this.handle = handle;
            JointCount = joints;
            Joints = new Joint[BlockFrames * joints];
        }

        public int JointCount { get; }

        /// <summary>The four frames of the last Poll that was true.</summary>
        public Frame[] Frames { get; } = new Frame[BlockFrames];

        /// <summary>Their joints: joint j of frame i is Joints[i * JointCount + j].</summary>
        public Joint[] Joints { get; }

        /// <summary>Appends mono samples, full scale 1, of 8000 to 192000 Hz, up to a minute (SessionOptions.VoiceAhead) ahead of time; more is dropped and counted.</summary>
        /// <exception cref="ArgumentException">A bad rate: nothing was taken. Samples that are not finite: silence is in their place, all others were taken.</exception>
        public void PushAudio(Speaker speaker, float[] samples, int offset, int count, int rate)
        {
            if (speaker != Speaker.Agent && speaker != Speaker.User) throw new ArgumentOutOfRangeException(nameof(speaker), speaker, "Agent or User");
            var pinned = Pin(samples, offset, count, out var first);
            try
            {
                var number = (UIntPtr)count;
                var hertz = (uint)Math.Max(rate, 0);
                Errors.Check(speaker == Speaker.Agent ? Native.visavis_session_push_agent_audio(handle, first, number, hertz)
                    : Native.visavis_session_push_user_audio(handle, first, number, hertz));
            }
            finally
            {
                pinned.Free();
            }
        }

        static GCHandle Pin(float[] samples, int offset, int count, out IntPtr first)
        {
            if (samples == null) throw new ArgumentNullException(nameof(samples));
            if (offset < 0 || count < 0 || count > samples.Length - offset)
                throw new ArgumentOutOfRangeException(nameof(count), count, "samples from offset on that lie in the array");
            var pinned = GCHandle.Alloc(samples, GCHandleType.Pinned);
            // A pinned array of no elements may have no address.
            first = count == 0 ? new IntPtr(4) : Marshal.UnsafeAddrOfPinnedArrayElement(samples, offset);
            return pinned;
        }

        public void PushAudio(Speaker speaker, float[] samples, int rate) => PushAudio(speaker, samples, 0, samples?.Length ?? 0, rate);

        public void PushAgentAudio(float[] samples, int rate) => PushAudio(Speaker.Agent, samples, rate);

        public void PushUserAudio(float[] samples, int rate) => PushAudio(Speaker.User, samples, rate);

        /// <summary>Ends an utterance: the last milliseconds come out of the resampler. Optional.</summary>
        public void FinishAudio(Speaker speaker) => Errors.Check(Native.visavis_session_finish_audio(handle, (int)speaker));

        /// <summary>Breaks an utterance off: drops all sound that has not been used.</summary>
        public void ClearAudio(Speaker speaker) => Errors.Check(Native.visavis_session_clear_audio(handle, (int)speaker));

        /// <summary>Makes a voice present, silent until something is pushed, or absent until the next push.</summary>
        public void SetAudioPresent(Speaker speaker, bool present) =>
            Errors.Check(Native.visavis_session_set_audio_present(handle, (int)speaker, present ? 1 : 0));

        /// <summary>Where the midpoint of the user's eyes is, session world. Late and impossible positions are ignored and counted.</summary>
        public void PushUserHead(float x, float y, float z, double time) => Errors.Check(Native.visavis_session_push_user_head(handle, x, y, z, time));

        /// <summary>The same with the head's rotation: a quaternion of about unit length, identity where the user faces +Z. Bundles of the kind `dram` see it.</summary>
        public void PushUserPose(float x, float y, float z, float qx, float qy, float qz, float qw, double time) =>
            Errors.Check(Native.visavis_session_push_user_pose(handle, x, y, z, qx, qy, qz, qw, time));

        /// <summary>
        /// A piece of what sound source `id` in the room gives off: mono samples of 8000 to 192000 Hz, pascals as they are 1 m from it (RMS 1 is 94 dB
        /// SPL); x, y, z is where it is from now on, session world. The first piece sounds from the next block on, further ones follow it, up to ten
        /// seconds ahead; none moves a source that sounds. Sixteen sound at once, the loudest ones.
        /// </summary>
        /// <exception cref="ArgumentException">
        /// The bundle has no hearing (Engine.HasHearing) or the rate is bad: nothing was taken. A place that is not finite: sound of a source that has one
        /// was taken. Samples that are not finite: silence is in their place.
        /// </exception>
        public void PushSound(uint id, float[] samples, int offset, int count, int rate, float x, float y, float z)
        {
            var pinned = Pin(samples, offset, count, out var first);
            try
            {
                Errors.Check(Native.visavis_session_push_sound(handle, id, first, (UIntPtr)count, (uint)Math.Max(rate, 0), x, y, z));
            }
            finally
            {
                pinned.Free();
            }
        }

        public void PushSound(uint id, float[] samples, int rate, float x, float y, float z) => PushSound(id, samples, 0, samples?.Length ?? 0, rate, x, y, z);

        /// <summary>Ends a sound source at once.</summary>
        /// <exception cref="ArgumentException">The bundle has no hearing.</exception>
        public void EndSound(uint id) => Errors.Check(Native.visavis_session_end_sound(handle, id));

        /// <summary>
        /// A piece of what two microphones at the agent's ears hear, pascals, `count` samples of each from `offset` on, of 8000 to 192000 Hz: for hosts that
        /// do not know where sounds are. The direction is estimated as the agent's head turns. The first piece is heard from the next block on, further
        /// ones follow it, up to ten seconds ahead. One thread at a time.
        /// </summary>
        /// <exception cref="ArgumentException">
        /// The bundle has no hearing (Engine.HasHearing) or the rate is bad: nothing was taken. Samples that are not finite: silence is in their place.
        /// </exception>
        public void PushEars(float[] left, float[] right, int offset, int count, int rate)
        {
            var pinned = Pin(left, offset, count, out var first);
            try
            {
                var other = Pin(right, offset, count, out var second);
                try
                {
                    Errors.Check(Native.visavis_session_push_ears(handle, first, second, (UIntPtr)count, (uint)Math.Max(rate, 0)));
                }
                finally
                {
                    other.Free();
                }
            }
            finally
            {
                pinned.Free();
            }
        }

        /// <summary>All of two arrays of one length.</summary>
        public void PushEars(float[] left, float[] right, int rate)
        {
            if (left != null && right != null && left.Length != right.Length)
                throw new ArgumentException(left.Length + " samples of the left ear and " + right.Length + " of the right one: push as many of both");
            PushEars(left, right, 0, left?.Length ?? 0, rate);
        }

        /// <summary>Ends what the ears brought at once.</summary>
        /// <exception cref="ArgumentException">The bundle has no hearing.</exception>
        public void EndEars() => Errors.Check(Native.visavis_session_end_ears(handle));

        /// <summary>
        /// Where the last block took what stands out among the sounds to be, session world: the place of a source, or the direction that was estimated of what
        /// PushEars brought, 2 m away and 1.5 m over the floor. False while nothing is known.
        /// </summary>
        public bool HeardPlace(out float x, out float y, out float z)
        {
            var position = new float[3];
            Errors.Check(Native.visavis_session_heard_place(handle, position, out var known));
            x = position[0];
            y = position[1];
            z = position[2];
            return known != 0;
        }

        /// <summary>How much the agent minds sounds in the room: -1 dull, 0 neutral, 1 sensitive, up to 1.5 either way.</summary>
        public void SetSensitivity(float sensitivity) => Errors.Check(Native.visavis_session_set_sensitivity(handle, sensitivity));

        /// <summary>0 averted to 1 sustained eye contact; null: what comes naturally.</summary>
        public void SetGaze(float? target) =>
            Errors.Check(target.HasValue ? Native.visavis_session_set_gaze(handle, target.Value) : Native.visavis_session_set_natural_gaze(handle));

        /// <summary>Guidance weights, 0 to 20.</summary>
        public void SetGuidance(float weight, float gaze) => Errors.Check(Native.visavis_session_set_guidance(handle, weight, gaze));

        public void SetSampler(SamplerKind kind, int steps) => Errors.Check(Native.visavis_session_set_sampler(handle, (int)kind, (uint)Math.Max(steps, 0)));

        /// <summary>Milliseconds that a block may take, 1 to 133.3: a governor then chooses samplers. 0: none.</summary>
        public void SetBudget(float milliseconds) => Errors.Check(Native.visavis_session_set_budget(handle, milliseconds));

        /// <summary>
        /// Gives a session with a budget an engine of the kind `dram`, of the same rig and delays, to step down to: where blocks of even the cheapest sampler
        /// come late, that engine makes the motion, instead of a pose being held. Dyadic tells of its frames, GovernorFallbackBlocks counts its blocks. A
        /// reset keeps it; the engine may be disposed afterwards.
        /// </summary>
        /// <exception cref="ArgumentException">This session's own engine is of the kind `dram`, the other is not, or their rigs or delays differ.</exception>
        public void SetFallback(Engine engine)
        {
            if (engine == null) throw new ArgumentNullException(nameof(engine));
            Errors.Check(Native.visavis_session_set_fallback(handle, engine.Handle));
        }

        /// <summary>Tells the governor a block's time as the host measured it.</summary>
        public void ReportBlockTime(double milliseconds) => Errors.Check(Native.visavis_session_report_block_time(handle, milliseconds));

        /// <summary>Computes the block that is due at `now`, which never runs backwards. True: Frames and Joints are new; call it until it is false.</summary>
        public bool Poll(double now)
        {
            Errors.Check(Native.visavis_session_poll(handle, now, Frames, (UIntPtr)Marshal.SizeOf(typeof(Frame)), Joints, (UIntPtr)Joints.Length, out var count));
            return count > 0;
        }

        /// <summary>
        /// How much each joint of the last block's frames follows the user rather than the agent's own voice and habit, 0 to 1, into room for
        /// Joints.Length numbers. Returns how many those are: 0 before the first block and where a bundle of another kind than `dram` made the last.
        /// </summary>
        public int Dyadic(float[] shares)
        {
            Errors.Check(Native.visavis_session_dyadic(handle, shares, (UIntPtr)(shares?.Length ?? 0), out var count));
            return (int)count;
        }

        /// <summary>Session time at which the next block is due, seconds.</summary>
        public double NextDue()
        {
            Errors.Check(Native.visavis_session_next_due(handle, out var time));
            return time;
        }

        /// <summary>Starts anew with the options of now: time 0, the same bits for the same inputs.</summary>
        public void Reset() => Errors.Check(Native.visavis_session_reset(handle));

        /// <summary>Computes blocks for nothing and starts anew, so that the first block finds memory and CPU warm.</summary>
        public void WarmUp(int blocks) => Errors.Check(Native.visavis_session_warm_up(handle, (uint)Math.Max(blocks, 0)));

        public Stats Statistics()
        {
            var stats = new Stats { StructSize = (uint)Marshal.SizeOf(typeof(Stats)) };
            Errors.Check(Native.visavis_session_stats(handle, ref stats));
            return stats;
        }

        public void Dispose() => handle.Dispose();
    }
}
