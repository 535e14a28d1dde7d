using System;
using UnityEngine;

namespace Visavis.Unity
{
    /// <summary>Clips as the session takes them.</summary>
    public static class Sound
    {
        /// <summary>All samples of a clip, its channels averaged. The clip's Load Type must be Decompress On Load.</summary>
        public static float[] Mono(AudioClip clip)
        {
            if (clip == null) throw new ArgumentNullException(nameof(clip));
            var all = new float[clip.samples * clip.channels];
            if (!clip.GetData(all, 0)) throw new ArgumentException(clip.name + ": its samples cannot be read; set its Load Type to Decompress On Load");
            return Mix(all, clip.channels);
        }

        internal static float[] Mix(float[] interleaved, int channels)
        {
            if (channels == 1) return interleaved;
            var mono = new float[interleaved.Length / channels];
            for (int i = 0; i < mono.Length; i++)
            {
                float sum = 0;
                for (int c = 0; c < channels; c++) sum += interleaved[i * channels + c];
                mono[i] = sum / channels;
            }
            return mono;
        }
    }
}
