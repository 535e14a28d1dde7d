using System;

namespace Visavis.Tests
{
    internal static class LeakTest
    {
        /// <summary>Sessions that are disposed, and one in 25 left to the collector.</summary>
        public static void Run(int sessions)
        {
            var voice = Check.Voice(480);
            for (int i = 0; i < sessions / 10; i++) One(i, voice);
            var before = Check.Memory();
            for (int i = 0; i < sessions; i++) One(i, voice);
            var grown = Check.Memory() - before;
            Console.WriteLine("resident memory after " + sessions + " sessions: " + before.ToString("0") + " MB and " + grown.ToString("0.0") + " MB");
            // A session of the tiny bundle is megabytes: one in a thousand that is leaked would show.
            Check.That(grown < 64, "sessions are leaked");
        }

        static void One(int i, float[] voice)
        {
            var session = Check.Tiny.NewSession();
            session.PushAgentAudio(voice, 48000);
            Check.That(session.Poll(0), "a block");
            if (i % 25 != 0) session.Dispose();
            if (i % 50 == 49) Collect();
        }

        static void Collect()
        {
            GC.Collect();
            GC.WaitForPendingFinalizers();
        }
    }
}
