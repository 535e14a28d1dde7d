using System;
using System.Threading;

namespace Visavis.Tests
{
    internal static class ThreadTests
    {
        public static void Run()
        {
            PushesAreNeverRefused();
            PosesAreTheSessions();
            SpeechStartsWithABlock();
            FailuresAreTold();
        }

        static void PushesAreNeverRefused()
        {
            using (var session = Check.Tiny.NewSession())
            {
                var threads = new Thread[2];
                var failures = new Exception[2];
                for (int t = 0; t < 2; t++)
                {
                    int voice = t;
                    threads[t] = new Thread(() =>
                    {
                        try
                        {
                            for (int i = 0; i < 2000; i++)
                            {
                                session.PushAudio((Speaker)voice, new float[96], 48000);
                                session.PushUserHead(0, 1.6f, 1.5f, 0.01 * (2 * i + voice));
                                session.SetGaze(0.5f);
                                session.SetSampler(SamplerKind.Midpoint, 1 + (i & 1));
                            }
                        }
                        catch (Exception e)
                        {
                            failures[voice] = e;
                        }
                    });
                    threads[t].Start();
                }
                for (int k = 0; k < 20; k++) Check.That(session.Poll(1e6), "a block");
                for (int t = 0; t < 2; t++)
                {
                    threads[t].Join();
                    Check.That(failures[t] == null, "a push was refused: " + failures[t]);
                }
                session.Poll(1e6);
                var stats = session.Statistics();
                Check.That(stats.HeadAccepted + stats.HeadOutOfOrder + stats.HeadOverwritten >= 4000, "heads");
                Check.That(stats.AgentContendedSamples + stats.UserContendedSamples == 0, "no sound was lost");
            }
        }

        static void PosesAreTheSessions()
        {
            using (Session plain = Check.Tiny.NewSession(), played = Check.Tiny.NewSession())
            {
                double now = 0;
                var pose = new Joint[played.JointCount];
                using (var motion = new MotionThread(played, () => Volatile.Read(ref now)))
                {
                    Wait(() => motion.Sample(0, pose, out var first) && first.Index == 0);
                    Volatile.Write(ref now, 0.5);
                    Wait(() => motion.Sample(9, pose, out var last) && last.Index == 15);
                    for (int k = 0; k < 4; k++)
                    {
                        Check.That(plain.Poll(plain.NextDue()), "a block");
                        for (int i = 0; i < 4; i++)
                        {
                            Check.That(motion.Sample(plain.Frames[i].Time + 1e-9, pose, out var frame), "a pose");
                            Check.That(Math.Abs(frame.HipsX - plain.Frames[i].HipsX) < 1e-5, "hips");
                            for (int j = 0; j < pose.Length; j++)
                            {
                                var joint = plain.Joints[i * pose.Length + j];
                                Check.That(Math.Abs(pose[j].LocalX - joint.LocalX) < 1e-5 && Math.Abs(pose[j].PositionZ - joint.PositionZ) < 1e-5, "joints");
                            }
                        }
                    }
                    Check.That(motion.Sample(1.5 / 30, pose, out var between) && Math.Abs(between.Time - 1.5 / 30) < 1e-6, "between frames");
                    foreach (var j in pose)
                        Check.That(Math.Abs(j.LocalX * j.LocalX + j.LocalY * j.LocalY + j.LocalZ * j.LocalZ + j.LocalW * j.LocalW - 1) < 1e-5, "rotations");
                    Check.Throws<ArgumentException>(() => motion.Sample(0, new Joint[3], out _));
                    Check.Throws<ArgumentException>(() => motion.Sample(double.NaN, pose, out _));
                }
            }
        }

        // The same bits as a session to which the sound was pushed when the block began that says so.
        static void SpeechStartsWithABlock()
        {
            var voice = Check.Voice(9600);
            using (Session plain = Check.Tiny.NewSession(), played = Check.Tiny.NewSession())
            {
                double now = 0.2;
                var pose = new Joint[played.JointCount];
                using (var motion = new MotionThread(played, () => Volatile.Read(ref now)))
                {
                    Wait(() => motion.Sample(9, pose, out var frame) && frame.Index == 7);
                    var first = motion.Speak(voice, 24000);
                    var second = motion.Speak(voice, 24000);
                    Wait(() => !double.IsNaN(second.Start));
                    Check.That(Math.Abs(first.Start - 8 / 30.0) < 1e-9, "the next block");
                    Check.That(Math.Abs(second.Start - first.Start - 0.4) < 1e-9, "one after the other");
                    Volatile.Write(ref now, 1);
                    Wait(() => motion.Sample(9, pose, out var frame) && frame.Index == 31);
                }
                for (int k = 0; k < 8; k++)
                {
                    if (k == 2)
                        for (int i = 0; i < 2; i++)
                        {
                            plain.PushAgentAudio(voice, 24000);
                            plain.FinishAudio(Speaker.Agent);
                        }
                    plain.Poll(plain.NextDue());
                }
                for (int j = 0; j < pose.Length; j++)
                    Check.That(pose[j].PositionX == plain.Joints[3 * pose.Length + j].PositionX, "what was said moves it");
            }
        }

        static void FailuresAreTold()
        {
            var session = Check.Tiny.NewSession();
            double now = 0;
            var motion = new MotionThread(session, () => Volatile.Read(ref now));
            Volatile.Write(ref now, double.NaN);
            Wait(() => motion.Failure != null);
            Check.That(motion.Failure is ArgumentException, "a clock that is no number: " + motion.Failure);
            motion.Dispose();
            Check.Throws<ObjectDisposedException>(() => motion.Hush());
            session.Dispose();
        }

        static void Wait(Func<bool> done)
        {
            // A bound for a test that hangs, not a measure.
            for (int i = 0; !done(); i++)
            {
                Check.That(i < 60000, "it never came");
                Thread.Sleep(1);
            }
        }
    }
}
