using System;
using System.Collections;
using UnityEngine;

namespace Visavis.Unity
{
    /// <summary>The user's voice: pushes what the microphone hears to the agent of the same object. Disable it to stop listening.</summary>
    [RequireComponent(typeof(VisavisAgent))]
    [AddComponentMenu("Visavis/Microphone")]
    public sealed class VisavisMicrophone : MonoBehaviour
    {
        [Tooltip("Name of a microphone; empty: the system's.")]
        public string device = "";

        /// <summary>Whether it listens; false without permission or a device.</summary>
        public bool IsListening { get; private set; }

        VisavisAgent agent;
        AudioClip heard;
        int read;

        string Device => string.IsNullOrEmpty(device) ? null : device;

        void OnEnable()
        {
            agent = GetComponent<VisavisAgent>();
            StartCoroutine(Listen());
        }

        IEnumerator Listen()
        {
            yield return Application.RequestUserAuthorization(UserAuthorization.Microphone);
            if (!Application.HasUserAuthorization(UserAuthorization.Microphone) || Microphone.devices.Length == 0)
            {
                Debug.LogWarning("Visavis: no microphone, or no permission to use it; the agent goes on without the user's voice", this);
                yield break;
            }
            while (agent.Session == null) yield return null;
            heard = Microphone.Start(Device, true, 1, 16000);
            read = 0;
            IsListening = heard != null;
        }

        void Update()
        {
            if (!IsListening || agent.Session == null) return;
            if (!Microphone.IsRecording(Device))
            {
                Lose();
                Debug.LogWarning("Visavis: the microphone is gone; enable this component again to go on", this);
                return;
            }
            int now = Microphone.GetPosition(Device), count = (now - read + heard.samples) % heard.samples;
            if (count == 0) return;
            var samples = new float[count * heard.channels];
            heard.GetData(samples, read);
            read = now;
            try
            {
                agent.Session.PushUserAudio(Sound.Mix(samples, heard.channels), heard.frequency);
            }
            catch (Exception e)
            {
                Debug.LogWarning("Visavis: " + e.Message, this);
            }
        }

        // The voice is absent afterwards, which is not the same as silent.
        void Lose()
        {
            if (!IsListening) return;
            IsListening = false;
            Microphone.End(Device);
            try
            {
                agent.Session?.SetAudioPresent(Speaker.User, false);
            }
            catch (ObjectDisposedException)
            {
                // The agent went first.
            }
        }

        void OnDisable() => Lose();
    }
}
