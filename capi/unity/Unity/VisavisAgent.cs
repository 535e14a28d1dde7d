using System;
using System.Collections;
using System.Diagnostics;
using System.IO;
using UnityEngine;
using UnityEngine.Networking;

namespace Visavis.Unity
{
    /// <summary>An agent: loads the bundle, computes its motion on a thread, and shows it on the Humanoid avatar of `animator`.</summary>
    /// <remarks>
    /// This object's transform is the session's world when play starts: the agent begins at its origin and faces its +Z. Leave the Animator's controller empty
    /// and root motion off.
    /// </remarks>
    [DisallowMultipleComponent]
    [AddComponentMenu("Visavis/Agent")]
    public sealed class VisavisAgent : MonoBehaviour
    {
        [Tooltip("A bundle in Assets/StreamingAssets.")]
        public string bundle = "visavis-room-i8.safetensors";

        [Tooltip("The Humanoid avatar; none: spheres.")]
        public Animator animator;

        [Tooltip("The user's eyes; none: the main camera.")]
        public Transform userHead;

        [Tooltip("Where the agent's voice comes from; none: no sound.")]
        public AudioSource voice;

        [Tooltip("0 averted to 1 sustained eye contact; negative: what comes naturally.")]
        [Range(-1, 1)]
        public float gaze = 0.8f;

        [Tooltip("How much it minds sounds in the room: -1 dull, 1 sensitive. Of bundles with hearing.")]
        [Range(-1, 1)]
        public float sensitivity = 0;

        [Tooltip("Milliseconds that a block may take; 0: no governor.")]
        [Range(0, 133)]
        public float budget = 100;

        [Tooltip("Seconds from a frame's session time to its showing: what computing a block may take.")]
        [Range(0.03f, 0.5f)]
        public float latency = 0.12f;

        /// <summary>What went wrong, and what to do; raised once, on the main thread.</summary>
        public event Action<Exception> Failed;

        readonly Stopwatch time = new Stopwatch();
        Engine engine;
        Session session;
        MotionThread motion;
        SourceBody body;
        HumanPoseHandler source, target;
        HumanPose human;
        Joint[] pose;
        Utterance saying;
        AudioClip clip;
        float shownGaze, shownBudget, shownSensitivity;
        bool failed;

        /// <summary>The session once it runs, for pushes and settings; null before. Its Poll is the thread's.</summary>
        public Session Session => motion == null ? null : session;

        /// <summary>Whether it hears sounds in the room (VisavisSound): whether its bundle has hearing. False while it loads.</summary>
        public bool HasHearing => motion != null && engine.HasHearing;

        /// <summary>Session time, seconds; stands still while the application is paused.</summary>
        public double SessionTime => time.Elapsed.TotalSeconds;

        IEnumerator Start()
        {
            var path = Path.Combine(Application.streamingAssetsPath, bundle);
            byte[] bytes = null;
            if (path.Contains("://"))
            {
                using (var request = UnityWebRequest.Get(path))
                {
                    yield return request.SendWebRequest();
                    if (request.result != UnityWebRequest.Result.Success)
                    {
                        Fail(new IOException(path + ": " + request.error + "; put the bundle into Assets/StreamingAssets"));
                        yield break;
                    }
                    bytes = request.downloadHandler.data;
                }
            }
            var loading = System.Threading.Tasks.Task.Run(() => bytes == null ? Engine.FromPath(path) : Engine.FromBytes(bytes));
            while (!loading.IsCompleted) yield return null;
            if (this == null || failed)
            {
                if (!loading.IsFaulted) loading.Result.Dispose();
                yield break;
            }
            if (loading.IsFaulted) Fail(loading.Exception.GetBaseException());
            else Begin(loading.Result);
        }

        void Begin(Engine loaded)
        {
            engine = loaded;
            try
            {
                var options = Engine.Options();
                options.Gaze = gaze < 0 ? float.NaN : gaze;
                options.BudgetMs = Math.Abs(budget) < 1 ? 0 : budget;
                options.Sensitivity = sensitivity;
                shownSensitivity = sensitivity;
                shownGaze = gaze;
                shownBudget = budget;
                session = engine.NewSession(options);
                session.WarmUp(1);
                pose = new Joint[engine.JointCount];
                body = new SourceBody(engine, transform);
                if (animator == null) body.AddSpheres();
                else if (animator.avatar == null || !animator.avatar.isHuman)
                    throw new InvalidOperationException(animator.name + ": the avatar is no Humanoid; set Rig, Animation Type of its model to Humanoid");
                else
                {
                    source = new HumanPoseHandler(body.Avatar, body.Root);
                    target = new HumanPoseHandler(animator.avatar, animator.transform);
                }
                time.Restart();
                motion = new MotionThread(session, () => SessionTime);
            }
            catch (Exception e)
            {
                Fail(e);
            }
        }

        /// <summary>Says a clip, from the next block on or after what is being said; its sound plays on `voice` in step with the motion.</summary>
        public void Say(AudioClip speech)
        {
            if (motion == null) throw new InvalidOperationException("the agent is still loading, or has failed: see Failed");
            if (saying != null) throw new InvalidOperationException("the agent has a clip waiting: call Say when IsWaiting is false");
            clip = speech;
            saying = motion.Speak(Sound.Mono(speech), speech.frequency);
        }

        /// <summary>Whether a clip waits to be given to the loudspeaker, which takes some milliseconds.</summary>
        public bool IsWaiting => saying != null;

        void Update()
        {
            if (motion == null || failed) return;
            try
            {
                if (motion.Failure != null) throw motion.Failure;
                var head = userHead != null ? userHead : Camera.main != null ? Camera.main.transform : null;
                if (head != null)
                {
                    var eyes = Axes.ToSession(transform.InverseTransformPoint(head.position));
                    var facing = Axes.ToSession(Quaternion.Inverse(transform.rotation) * head.rotation);
                    session.PushUserPose(eyes.x, eyes.y, eyes.z, facing.x, facing.y, facing.z, facing.w, SessionTime);
                }
                if (gaze != shownGaze) session.SetGaze((shownGaze = gaze) < 0 ? (float?)null : gaze);
                if (sensitivity != shownSensitivity) session.SetSensitivity(shownSensitivity = sensitivity);
                if (budget != shownBudget) session.SetBudget((shownBudget = budget) < 1 ? 0 : budget);
                if (saying != null && !double.IsNaN(saying.Start)) PlayInStep();
            }
            catch (Exception e)
            {
                Fail(e);
            }
        }

        // A frame is shown `latency` after its session time, and so is the sound.
        void PlayInStep()
        {
            if (voice != null)
            {
                voice.clip = clip;
                voice.PlayScheduled(AudioSettings.dspTime + Math.Max(0, saying.Start + latency - SessionTime));
            }
            saying = null;
            clip = null;
        }

        void LateUpdate()
        {
            if (motion == null || failed || !motion.Sample(SessionTime - latency, pose, out var frame)) return;
            body.Show(frame, pose);
            if (target == null) return;
            source.GetHumanPose(ref human);
            target.SetHumanPose(ref human);
        }

        void OnApplicationPause(bool paused)
        {
            if (paused) time.Stop();
            else if (motion != null) time.Start();
        }

        void Fail(Exception e)
        {
            failed = true;
            UnityEngine.Debug.LogError("Visavis: " + e.Message, this);
            Failed?.Invoke(e);
        }

        void OnDestroy()
        {
            failed = true;
            motion?.Dispose();
            session?.Dispose();
            engine?.Dispose();
            source?.Dispose();
            target?.Dispose();
            body?.Dispose();
        }
    }
}
