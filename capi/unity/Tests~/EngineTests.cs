using System;
using System.IO;

namespace Visavis.Tests
{
    internal static class EngineTests
    {
        public static void Run()
        {
            var engine = Check.Tiny;
            Check.That(Engine.Version.Length > 0 && engine.Name.Length > 0, "names");
            Check.That(engine.JointCount == 22 && engine.JointName(0) == "hips" && engine.JointName(5) == "head", "joints");
            Check.That(engine.JointParent(0, out _, out var y, out _) == -1 && y > 0.5f, "the hips' height");
            Check.That(engine.JointForOpenXr(1) == 0 && engine.JointForOpenXr(0) == -1 && engine.JointForOpenXr(-5) == -1, "OpenXR");
            Check.Throws<ArgumentOutOfRangeException>(() => engine.JointName(22));
            Check.Throws<ArgumentOutOfRangeException>(() => engine.JointName(-1));

            var bytes = File.ReadAllBytes(Check.Bundle);
            using (var second = Engine.FromBytes(bytes)) Check.That(second.Name == engine.Name, "the same from memory");
            var folder = Path.Combine(Path.GetTempPath(), "visavis Größe 模型 " + Guid.NewGuid());
            Directory.CreateDirectory(folder);
            try
            {
                var path = Path.Combine(folder, "für Zoë.safetensors");
                File.Copy(Check.Bundle, path);
                Engine.FromPath(path).Dispose();
            }
            finally
            {
                Directory.Delete(folder, true);
            }

            Check.Throws<IOException>(() => Engine.FromPath("/nowhere/model.safetensors"), "/nowhere/model.safetensors");
            Check.Throws<ArgumentException>(() => Engine.FromPath(Check.Bundle + "\0.txt"));
            Check.Throws<ArgumentNullException>(() => Engine.FromPath(null));
            Check.Throws<ArgumentNullException>(() => Engine.FromBytes(null));
            Check.That(Check.Throws<BundleException>(() => Engine.FromBytes(new byte[0])).Status == Status.BundleCorrupt, "nothing at all");
            var half = new byte[bytes.Length / 2];
            Array.Copy(bytes, half, half.Length);
            Check.That(Check.Throws<BundleException>(() => Engine.FromBytes(half)).Status == Status.BundleCorrupt, "half a bundle");
            for (int i = 1; i < 5; i++) bytes[bytes.Length - i] = 0xff;
            Check.That(Check.Throws<BundleException>(() => Engine.FromBytes(bytes)).Status == Status.BundleCorrupt, "weights that are not numbers");

            var gone = Engine.FromPath(Check.Bundle);
            gone.Dispose();
            gone.Dispose();
            Check.Throws<ObjectDisposedException>(() => gone.NewSession());
            Check.Throws<ObjectDisposedException>(() => gone.JointName(0));
            Check.Throws<ObjectDisposedException>(() => { var _ = gone.Name; });

            var options = Engine.Options();
            Check.That(options.Threads == 1 && float.IsNaN(options.Gaze) && options.SamplerSteps == 4, "defaults");
            options.Threads = 3;
            Check.Throws<ArgumentException>(() => engine.NewSession(options));
            options = Engine.Options();
            options.VoiceAhead = 0.4;
            Check.Throws<ArgumentException>(() => engine.NewSession(options), "voice_ahead");
            options.VoiceAhead = 0.5;
            using (var session = engine.NewSession(options))
            {
                session.PushAgentAudio(new float[24000], 24000);
                Check.That(session.Statistics().AgentVoice.OverflowSamples == 12000, "half a second fits");
            }
            options = Engine.Options();
            options.SamplerKind = 77;
            Check.Throws<ArgumentException>(() => engine.NewSession(options));
            options = Engine.Options();
            options.StructSize = 3;
            Check.That(Check.Throws<VisavisException>(() => engine.NewSession(options)).Status == Status.Abi, "another version's options");
            // Options that were never filled: of size 0, hence refused.
            Check.Throws<VisavisException>(() => engine.NewSession(default(SessionOptions)));
        }
    }
}
