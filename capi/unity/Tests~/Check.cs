using System;
using System.IO;
using System.Runtime.InteropServices;

namespace Visavis.Tests
{
    /// <summary>What the tests share: assertions, the tiny bundle, and a conversation to drive a session with.</summary>
    internal static class Check
    {
        public static Engine Tiny;
        public static string Bundle;

        public static void That(bool holds, string what)
        {
            if (!holds) throw new Exception("FAILED: " + what);
        }

        public static T Throws<T>(Action action, string part = "") where T : Exception
        {
            try
            {
                action();
            }
            catch (T e)
            {
                That(e.GetType() == typeof(T), e.GetType() + " instead of " + typeof(T));
                That(e.Message.Length > 0 && e.Message.Contains(part), "`" + part + "` in: " + e.Message);
                return e;
            }
            throw new Exception("FAILED: no " + typeof(T));
        }

        public static double Memory()
        {
            foreach (var line in File.ReadAllLines("/proc/self/status"))
                if (line.StartsWith("VmRSS:")) return double.Parse(line.Split(new[] { ' ', '\t' }, StringSplitOptions.RemoveEmptyEntries)[1]) / 1024;
            return 0;
        }

        /// <summary>The inputs of `drive` in examples/smoke.c.</summary>
        public static float[] Voice(int length)
        {
            var voice = new float[length];
            for (int i = 0; i < length; i++)
            {
                var scaled = (float)(0.2f * (float)((i * 7) % 100 - 50));
                voice[i] = (float)(scaled / 50f);
            }
            return voice;
        }

        public static void Inputs(Session session, int block, float[] voice)
        {
            session.PushAgentAudio(voice, 44100);
            session.PushAudio(Speaker.User, voice, 0, 1600, 16000);
            session.PushUserHead((float)(0.1f * block), 1.6f, 1.5f, session.NextDue());
        }

        /// <summary>FNV of the bytes of a block's joints, as in examples/smoke.c.</summary>
        public static ulong Digest(ulong digest, Joint[] joints)
        {
            var pinned = GCHandle.Alloc(joints, GCHandleType.Pinned);
            var bytes = new byte[joints.Length * Marshal.SizeOf(typeof(Joint))];
            Marshal.Copy(pinned.AddrOfPinnedObject(), bytes, 0, bytes.Length);
            pinned.Free();
            foreach (var b in bytes) digest = unchecked((digest ^ b) * 0x100000001b3u);
            return digest;
        }

        static int Main(string[] arguments)
        {
            Bundle = arguments[0];
            Layouts.AreTheHeaders(arguments[1]);
            using (Tiny = Engine.FromPath(Bundle))
            {
                EngineTests.Run();
                SessionTests.Run();
                ThreadTests.Run();
                LeakTest.Run(int.Parse(arguments[3]));
            }
            Console.WriteLine("digest " + SessionTests.Motion.ToString("x16"));
            That(SessionTests.Motion.ToString("x16") == arguments[2], "the C face's digest is " + arguments[2]);
            Console.WriteLine("C#: all well");
            return 0;
        }
    }
}
