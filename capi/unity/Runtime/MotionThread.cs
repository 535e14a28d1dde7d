using System;
using System.Collections.Generic;
using System.Threading;

namespace Visavis
{
    /// <summary>Sound that was given to MotionThread.Speak.</summary>
    public sealed class Utterance
    {
        double start = double.NaN;

        /// <summary>Session time at which its first sample is heard; NaN until the thread has taken it, a few milliseconds.</summary>
        public double Start
        {
            get => Volatile.Read(ref start);
            internal set => Volatile.Write(ref start, value);
        }
    }

    /// <summary>Polls a session on a thread of its own, so that blocks cost the caller's frames nothing, and gives poses at any time between frames.</summary>
    /// <remarks>The clock is called from that thread: session time, seconds, never running backwards. The session stays the caller's to dispose, after this.</remarks>
    public sealed class MotionThread : IDisposable
    {
        const int Kept = 64;

        readonly Session session;
        readonly Func<double> clock;
        readonly Thread thread;
        readonly Queue<Action> posted = new Queue<Action>();
        readonly AutoResetEvent wake = new AutoResetEvent(false);
        readonly object history = new object();
        readonly Frame[] frames = new Frame[Kept];
        readonly Joint[] joints;
        long count;
        double spoken;
        volatile bool stopped;
        volatile Exception failure;

        public MotionThread(Session session, Func<double> clock)
        {
            this.session = session ?? throw new ArgumentNullException(nameof(session));
            this.clock = clock ?? throw new ArgumentNullException(nameof(clock));
            joints = new Joint[Kept * session.JointCount];
            thread = new Thread(Run) { Name = "Visavis", IsBackground = true, Priority = ThreadPriority.AboveNormal };
            thread.Start();
        }

        /// <summary>What ended the thread; null while it runs.</summary>
        public Exception Failure => failure;

        /// <summary>Pushes an utterance of the agent from the next block on, or after what it is saying. Do not change the samples.</summary>
        public Utterance Speak(float[] samples, int rate)
        {
            if (samples == null) throw new ArgumentNullException(nameof(samples));
            if (rate < 8000 || rate > 192000) throw new ArgumentOutOfRangeException(nameof(rate), rate, "8000 to 192000 Hz");
            var utterance = new Utterance();
            Post(() =>
            {
                // Between polls: sound that is pushed now is heard from the next block on.
                var start = Math.Max(session.NextDue(), spoken);
                session.PushAgentAudio(samples, rate);
                session.FinishAudio(Speaker.Agent);
                spoken = start + (double)samples.Length / rate;
                utterance.Start = start;
            });
            return utterance;
        }

        /// <summary>Breaks off what the agent says.</summary>
        public void Hush() => Post(() =>
        {
            session.ClearAudio(Speaker.Agent);
            spoken = 0;
        });

        /// <summary>Pose at a session time, between the two frames beside it, into `pose` (a joint each). False: no frame has come yet.</summary>
        /// <remarks>Before the oldest frame kept (two seconds) the oldest; after the newest the newest.</remarks>
        public bool Sample(double time, Joint[] pose, out Frame frame)
        {
            if (pose == null || pose.Length != session.JointCount) throw new ArgumentException("one joint for each of the session's", nameof(pose));
            lock (history)
            {
                frame = default(Frame);
                if (count == 0) return false;
                var place = Math.Min(Math.Max(time * Session.Rate, Math.Max(0, count - Kept)), count - 1);
                if (double.IsNaN(place)) throw new ArgumentException("a time is a number", nameof(time));
                var first = (long)Math.Floor(place);
                var second = Math.Min(first + 1, count - 1);
                Blend.Frames(frames[first % Kept], frames[second % Kept], place - first, out frame);
                int n = session.JointCount, a = (int)(first % Kept) * n, b = (int)(second % Kept) * n;
                for (int j = 0; j < n; j++) Blend.Joints(joints[a + j], joints[b + j], (float)(place - first), out pose[j]);
                return true;
            }
        }

        /// <summary>Ends the thread, waiting for a block that is being computed.</summary>
        public void Dispose()
        {
            stopped = true;
            wake.Set();
            if (Thread.CurrentThread != thread) thread.Join();
            wake.Dispose();
        }

        void Post(Action action)
        {
            if (stopped) throw new ObjectDisposedException(nameof(MotionThread));
            lock (posted) posted.Enqueue(action);
            wake.Set();
        }

        void Run()
        {
            try
            {
                while (!stopped)
                {
                    for (Action action; (action = Next()) != null;) action();
                    while (!stopped && session.Poll(clock())) Keep();
                    var wait = session.NextDue() - clock();
                    // Short, since a host's clock may run at its own pace or stand still.
                    wake.WaitOne(Math.Max(1, (int)Math.Min(wait * 1000, 8)));
                }
            }
            catch (Exception e)
            {
                failure = e;
            }
        }

        Action Next()
        {
            lock (posted) return posted.Count > 0 ? posted.Dequeue() : null;
        }

        void Keep()
        {
            lock (history)
            {
                int n = session.JointCount;
                for (int i = 0; i < Session.BlockFrames; i++, count++)
                {
                    frames[count % Kept] = session.Frames[i];
                    Array.Copy(session.Joints, i * n, joints, (int)(count % Kept) * n, n);
                }
            }
        }
    }
}
