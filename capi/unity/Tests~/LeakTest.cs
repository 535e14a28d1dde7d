using System;

namespace Visavis.Tests
{
    internal static class LeakTest
    {
        /// <summary>Sessions that are disposed, and every tenth left to the collector.</summary>
        public static void Run(int sessions)
        {
            var voice = Check.Voice(480);
            for (int i = 0; i < sessions / 10; i++) One(i, voice);
            Collect();
            var before = Check.Memory();
            for (int i = 0; i < sessions; i++)
            {
                One(i, voice);
                if (i % 100 == 99) Collect();
            }
            Collect();
            var grown = Check.Memory() - before;
            Console.WriteLine("resident memory after " + sessions + " sessions: " + before.ToString("0") + " MB and " + grown.ToString("0.0") + " MB");
            // A leaked session is a megabyte at least; one in a hundred would show.
            Check.That(grown < 64, "sessions are leaked");
        }

        static void One(int i, float[] voice)
        {
            var session = Check.Tiny.NewSession();
            session.PushAgentAudio(voice, 48000);
            Check.That(session.Poll(0), "a block");
            if (i % 10 != 0) session.Dispose();
        }

        static void Collect()
        {
            GC.Collect();
            GC.WaitForPendingFinalizers();
        }
    }
}
