using System;
using System.Threading;

namespace Visavis.Tests
{
    internal static class SessionTests
    {
        public static ulong Motion;

        static Session New(uint threads = 1)
        {
            var options = Engine.Options();
            options.Threads = threads;
            options.Gaze = 0.8f;
            var session = Check.Tiny.NewSession(options);
            session.WarmUp(1);
            return session;
        }

        static ulong Drive(Session session, int blocks)
        {
            var voice = Check.Voice(4410);
            ulong digest = 0xcbf29ce484222325u;
            for (int k = 0; k < blocks; k++)
            {
                Check.Inputs(session, k, voice);
                var due = session.NextDue();
                Check.That(session.Poll(due) && session.Frames[3].Index == (ulong)(4 * k + 3), "a block is due");
                digest = Check.Digest(digest, session.Joints);
                Check.That(!session.Poll(due), "one block, not two");
            }
            return digest;
        }

        public static void Run()
        {
            using (Session one = New(), two = New(2))
            {
                Motion = Drive(one, 4);
                Check.That(Motion == Drive(two, 4), "the same with two threads");
                var stats = one.Statistics();
                Check.That(stats.Blocks == 4 && stats.HeadAccepted == 4 && stats.CacheBytes > 0 && stats.BlockMsMax > 0, "statistics");
                one.Reset();
                Check.That(Motion == Drive(one, 4), "the same after a reset");
                BadInput(one);
            }
            Fallback();
            Sounds();
            Disposal();
            Outlives();
        }

        // Late blocks are left to a bundle of the featherweight tier, beside the first one; the outcome does not depend on the machine.
        static void Fallback()
        {
            var light = Engine.FromPath(System.IO.Path.Combine(System.IO.Path.GetDirectoryName(Check.Bundle), "dram-tcn.safetensors"));
            var options = Engine.Options();
            options.BudgetMs = 100;
            using (Session session = Check.Tiny.NewSession(options), other = light.NewSession())
            {
                Check.Throws<ArgumentException>(() => session.SetFallback(Check.Tiny), "`dram`");
                Check.Throws<ArgumentException>(() => other.SetFallback(light), "fall back");
                Check.Throws<ArgumentNullException>(() => session.SetFallback(null));
                session.SetFallback(light);
                light.Dispose();
                Check.Throws<ObjectDisposedException>(() => session.SetFallback(light));
                var shares = new float[session.Joints.Length];
                ulong fell = 0;
                for (int k = 0; k < 60; k++)
                {
                    Check.That(session.Poll(session.NextDue()), "a block is due");
                    int told = session.Dyadic(shares);
                    Check.That(told == 0 || told == shares.Length, "shares of a block");
                    if (told > 0) fell++;
                    session.ReportBlockTime(told > 0 ? 5 : 99999);
                }
                var stats = session.Statistics();
                Check.That(fell > 0 && stats.GovernorFallbackBlocks == fell && stats.GovernorHeldBlocks == 0, "the fallback made " + fell + " blocks");
            }
        }

        // Two blocks and more beside a bang, heard with a bundle with hearing beside the first one.
        static ulong BesideABang(Engine engine, bool bang, float x, float sensitivity)
        {
            var sound = new float[9600];
            for (int i = 0; i < sound.Length; i++) sound[i] = ((i * 7919) % 2000 - 1000) / 125f;
            var options = Engine.Options();
            options.Sensitivity = sensitivity;
            ulong digest = 0xcbf29ce484222325u;
            using (var session = engine.NewSession(options))
            {
                if (bang) session.PushSound(7, sound, 24000, x, 1, -2);
                for (int k = 0; k < 4; k++)
                {
                    Check.That(session.Poll(1), "a block is due");
                    digest = Check.Digest(digest, session.Joints);
                }
                Check.That(session.Statistics().SoundStarted == (bang ? 1u : 0u), "a source is counted");
            }
            return digest;
        }

        static void Sounds()
        {
            using (var engine = Engine.FromPath(System.IO.Path.Combine(System.IO.Path.GetDirectoryName(Check.Bundle), "hearing.safetensors")))
            {
                Check.That(engine.HasHearing && !Check.Tiny.HasHearing, "which bundle has hearing");
                var heard = BesideABang(engine, true, 1, 0);
                Check.That(heard == BesideABang(engine, true, 1, 0), "the same sound, the same motion");
                Check.That(heard != BesideABang(engine, false, 1, 0) && heard != BesideABang(engine, true, -1, 0) && heard != BesideABang(engine, true, 1, 1),
                    "a sound, its place and the sensitivity count");
                var options = Engine.Options();
                options.Sensitivity = 1.6f;
                Check.Throws<ArgumentException>(() => engine.NewSession(options), "sensitivity");
                using (Session session = engine.NewSession(), deaf = Check.Tiny.NewSession())
                {
                    Check.Throws<ArgumentException>(() => deaf.PushSound(1, new float[9], 24000, 0, 1, 2), "hearing");
                    Check.Throws<ArgumentException>(() => deaf.EndSound(1), "hearing");
                    Check.Throws<ArgumentException>(() => deaf.PushEars(new float[9], new float[9], 24000), "hearing");
                    Check.Throws<ArgumentException>(() => deaf.EndEars(), "hearing");
                    Check.Throws<ArgumentException>(() => session.PushEars(new float[9], new float[8], 24000), "as many");
                    Check.Throws<ArgumentNullException>(() => session.PushEars(new float[9], null, 24000));
                    Check.Throws<ArgumentOutOfRangeException>(() => session.PushEars(new float[9], new float[8], 0, 9, 24000));
                    session.PushEars(new float[9], new float[9], 24000);
                    session.EndEars();
                    Check.Throws<ArgumentException>(() => session.PushSound(1, new float[9], 24000, float.NaN, 1, 2), "metres");
                    Check.Throws<ArgumentException>(() => session.PushSound(1, new float[9], 0, 0, 1, 2));
                    Check.Throws<ArgumentException>(() => session.PushSound(1, new[] { 0, float.NaN }, 24000, 0, 1, 2));
                    Check.Throws<ArgumentNullException>(() => session.PushSound(1, null, 24000, 0, 1, 2));
                    Check.Throws<ArgumentOutOfRangeException>(() => session.PushSound(1, new float[8], 4, 5, 24000, 0, 1, 2));
                    Check.Throws<ArgumentException>(() => session.SetSensitivity(float.NaN), "sensitivity");
                    session.SetSensitivity(-1);
                    session.PushSound(1, new float[0], 24000, 0, 1, 3);
                    session.EndSound(1);
                    session.EndSound(2);
                    var stats = session.Statistics();
                    Check.That(stats.SoundBadPlaces == 1 && stats.SoundBadRateSamples == 9 && stats.SoundNonFiniteSamples == 1, "counted");
                }
            }
        }

        static void BadInput(Session session)
        {
            var before = session.Statistics();
            Check.Throws<ArgumentException>(() => session.PushUserAudio(new[] { 0.1f, float.NaN, 0.2f, float.PositiveInfinity }, 16000));
            Check.Throws<ArgumentException>(() => session.PushUserAudio(new float[8], 7999));
            Check.Throws<ArgumentException>(() => session.PushUserAudio(new float[8], -1));
            var after = session.Statistics();
            Check.That(after.UserNonFiniteSamples == before.UserNonFiniteSamples + 2 && after.UserBadRateSamples == before.UserBadRateSamples + 16, "counted");
            Check.Throws<ArgumentNullException>(() => session.PushAgentAudio(null, 16000));
            Check.Throws<ArgumentOutOfRangeException>(() => session.PushAudio(Speaker.Agent, new float[8], 4, 5, 16000));
            Check.Throws<ArgumentOutOfRangeException>(() => session.PushAudio(Speaker.Agent, new float[8], -1, 5, 16000));
            Check.Throws<ArgumentOutOfRangeException>(() => session.PushAudio(Speaker.Agent, new float[8], 0, int.MinValue, 16000));
            Check.Throws<ArgumentOutOfRangeException>(() => session.PushAudio((Speaker)2, new float[8], 16000));
            session.PushAudio(Speaker.Agent, new float[0], 16000);
            Check.Throws<ArgumentException>(() => session.FinishAudio((Speaker)9));
            Check.Throws<ArgumentException>(() => session.SetGaze(float.NaN));
            Check.Throws<ArgumentException>(() => session.SetGuidance(-1, 0));
            Check.Throws<ArgumentException>(() => session.SetSampler(SamplerKind.Euler, 65));
            Check.Throws<ArgumentException>(() => session.SetSampler((SamplerKind)7, 1));
            Check.Throws<ArgumentException>(() => session.SetBudget(float.NaN));
            Check.Throws<ArgumentException>(() => session.ReportBlockTime(-1));
            Check.Throws<ArgumentException>(() => session.Poll(double.NaN));
            Check.Throws<InvalidOperationException>(() => session.Poll(0));
            // Ignored and counted, not refused.
            session.PushUserHead(float.NaN, 0, 0, 1);
            session.PushUserHead(0, 1.6f, 1, double.PositiveInfinity);
            session.PushUserPose(0, 1.6f, 1.5f, 0, 0, 0, 1, 0);
            session.SetGaze(null);
            session.SetGaze(1);
            session.SetGuidance(1.3f, 2);
            session.SetSampler(SamplerKind.Midpoint, 2);
            session.SetBudget(100);
            session.ReportBlockTime(5);
            session.SetBudget(0);
            session.ClearAudio(Speaker.User);
            session.SetAudioPresent(Speaker.User, false);
            Check.That(session.Poll(session.NextDue()), "a block after all that");
            foreach (var joint in session.Joints)
                Check.That(!float.IsNaN(joint.PositionX + joint.LocalW + joint.RotationX), "frames are finite");
            Check.That(session.Dyadic(new float[session.Joints.Length]) == 0, "the flow model tells of no shares");
            Check.That(session.Statistics().HeadNonFinite == after.HeadNonFinite + 2, "heads that are no number are counted");
        }

        static void Disposal()
        {
            var session = New();
            session.Dispose();
            session.Dispose();
            Check.Throws<ObjectDisposedException>(() => session.Poll(0));
            Check.Throws<ObjectDisposedException>(() => session.PushAgentAudio(new float[4], 16000));
            Check.Throws<ObjectDisposedException>(() => session.SetGaze(null));
            Check.Throws<ObjectDisposedException>(() => session.Statistics());
            Check.Throws<ObjectDisposedException>(() => session.Reset());

            // While another thread polls and a third pushes: each ends in an exception of its own, none in a crash.
            for (int i = 0; i < 20; i++)
            {
                var shared = New();
                Exception polled = null, pushed = null;
                var poll = new Thread(() => polled = Until(() => shared.Poll(shared.NextDue())));
                var push = new Thread(() => pushed = Until(() => shared.PushUserAudio(new float[160], 16000)));
                poll.Start();
                push.Start();
                Thread.Sleep(i);
                shared.Dispose();
                poll.Join();
                push.Join();
                Check.That(polled is ObjectDisposedException && pushed is ObjectDisposedException, polled + "; " + pushed);
            }
        }

        static Exception Until(Action action)
        {
            try
            {
                while (true) action();
            }
            catch (Exception e)
            {
                return e;
            }
        }

        static void Outlives()
        {
            var engine = Engine.FromPath(Check.Bundle);
            using (var session = engine.NewSession())
            {
                engine.Dispose();
                Check.That(session.Poll(1), "a session outlives its engine");
            }
        }
    }
}
