using UnityEngine;
using Visavis.Unity;

/// <summary>Says a clip whenever the agent has been silent for some seconds, and shows what failed.</summary>
[RequireComponent(typeof(VisavisAgent))]
public sealed class Conversation : MonoBehaviour
{
    [Tooltip("What the agent says, in turn; Load Type Decompress On Load.")]
    public AudioClip[] speech = new AudioClip[0];

    [Tooltip("Silence between two clips, seconds.")]
    public float pause = 3;

    VisavisAgent agent;
    double next = 1;
    int said;
    string failure;

    void Awake()
    {
        agent = GetComponent<VisavisAgent>();
        agent.Failed += e => failure = e.Message;
    }

    void Update()
    {
        if (failure != null || agent.Session == null || agent.IsWaiting || speech.Length == 0 || agent.SessionTime < next) return;
        var clip = speech[said++ % speech.Length];
        agent.Say(clip);
        next = agent.SessionTime + clip.length + pause;
    }

    void OnGUI()
    {
        if (failure != null) GUI.Label(new Rect(20, 20, Screen.width - 40, 200), failure);
    }
}
