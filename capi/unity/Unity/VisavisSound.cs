using System;
using UnityEngine;

namespace Visavis.Unity
{
    /// <summary>Agents hear what the AudioSource of this object plays, from where it is: a dog, a door, a radio. Their bundles need hearing (visavis-room).</summary>
    [RequireComponent(typeof(AudioSource))]
    [AddComponentMenu("Visavis/Sound in the room")]
    public sealed class VisavisSound : MonoBehaviour
    {
        [Tooltip("Who hears it; empty: every agent that is there when this is enabled.")]
        public VisavisAgent[] agents = new VisavisAgent[0];

        [Tooltip("Sound pressure level 1 m away of a clip at full scale and full volume, dB: speech 70, a dog 90, a siren 110.")]
        [Range(40, 130)]
        public float level = 90;

        static uint sources;
        readonly uint id = ++sources;
        AudioSource source;
        AudioClip known;
        float[] samples;
        int read;
        bool sounded, warned;

        void OnEnable()
        {
            source = GetComponent<AudioSource>();
            if (agents.Length == 0) agents = FindObjectsOfType<VisavisAgent>();
        }

        void Update()
        {
            if (!source.isPlaying || source.clip == null)
            {
                End();
                return;
            }
            try
            {
                Read();
            }
            catch (Exception e)
            {
                Warn(e);
            }
        }

        // Pushes what has been played since the last frame.
        void Read()
        {
            if (known != source.clip)
            {
                samples = Sound.Mono(source.clip);
                known = source.clip;
                // Begun since the last frame: from its start.
                read = source.timeSamples < known.frequency / 5 ? 0 : source.timeSamples;
            }
            int now = source.timeSamples, count = now - read;
            // Looped, or set back.
            if (count < 0) count = source.loop ? count + samples.Length : now;
            count = Math.Min(count, known.frequency);
            if (count == 0) return;
            var piece = new float[count];
            var pascals = source.volume * (float)Math.Pow(10, (level - 94) / 20);
            for (int i = 0; i < count; i++) piece[i] = pascals * samples[(now - count + i + samples.Length) % samples.Length];
            read = now;
            foreach (var agent in agents)
            {
                if (agent == null || agent.Session == null || !agent.HasHearing) continue;
                var place = Axes.ToSession(agent.transform.InverseTransformPoint(transform.position));
                agent.Session.PushSound(id, piece, known.frequency, place.x, place.y, place.z);
                sounded = true;
            }
        }

        void End()
        {
            known = null;
            if (!sounded) return;
            sounded = false;
            foreach (var agent in agents)
            {
                try
                {
                    if (agent != null && agent.HasHearing) agent.Session?.EndSound(id);
                }
                catch (ObjectDisposedException)
                {
                    // The agent went first.
                }
            }
        }

        void Warn(Exception e)
        {
            if (!warned) Debug.LogWarning("Visavis: " + e.Message, this);
            warned = true;
        }

        void OnDisable() => End();
    }
}
