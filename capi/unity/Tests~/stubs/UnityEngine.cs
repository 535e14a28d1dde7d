// Stand-ins for the classes of Unity 2021.3 that this package names: for the compiler alone, they do nothing. Signatures are those of Unity's scripting reference.
#pragma warning disable CS0067, CS0649, CS0414, CS0169
using System;
using System.Collections;

namespace UnityEngine
{
    public class Object
    {
        public string name { get; set; }
        public static void Destroy(Object obj) { }
        public static T[] FindObjectsOfType<T>() where T : Object => new T[0];
        public static bool operator ==(Object a, Object b) => ReferenceEquals(a, b);
        public static bool operator !=(Object a, Object b) => !ReferenceEquals(a, b);
        public static implicit operator bool(Object exists) => !ReferenceEquals(exists, null);
        public override bool Equals(object other) => ReferenceEquals(this, other);
        public override int GetHashCode() => 0;
    }

    public class Component : Object
    {
        public Transform transform => null;
        public GameObject gameObject => null;
        public T GetComponent<T>() => default(T);
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; }
    }

    public class MonoBehaviour : Behaviour
    {
        public Coroutine StartCoroutine(IEnumerator routine) => null;
    }

    public sealed class GameObject : Object
    {
        public GameObject(string name) { }
        public Transform transform => null;
        public static GameObject CreatePrimitive(PrimitiveType type) => null;
    }

    public class Transform : Component
    {
        public Quaternion rotation { get; set; }
        public Vector3 position { get; set; }
        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; }
        public Vector3 localScale { get; set; }
        public void SetParent(Transform parent, bool worldPositionStays) { }
        public Vector3 InverseTransformPoint(Vector3 position) => position;
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 one => new Vector3(1, 1, 1);
        public static Vector3 operator *(Vector3 a, float d) => new Vector3(a.x * d, a.y * d, a.z * d);
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion operator *(Quaternion a, Quaternion b) => a;
        public static Quaternion Inverse(Quaternion rotation) => rotation;
    }

    public struct Rect
    {
        public Rect(float x, float y, float width, float height) { }
    }

    public enum PrimitiveType { Sphere, Capsule, Cylinder, Cube, Plane, Quad }

    public sealed class Avatar : Object
    {
        public bool isValid => false;
        public bool isHuman => false;
    }

    public class AvatarBuilder
    {
        public static Avatar BuildHumanAvatar(GameObject go, HumanDescription humanDescription) => null;
    }

    public struct HumanDescription
    {
        public HumanBone[] human;
        public SkeletonBone[] skeleton;
        public float upperArmTwist { get; set; }
        public float lowerArmTwist { get; set; }
        public float upperLegTwist { get; set; }
        public float lowerLegTwist { get; set; }
        public float armStretch { get; set; }
        public float legStretch { get; set; }
        public float feetSpacing { get; set; }
        public bool hasTranslationDoF { get; set; }
    }

    public struct HumanBone
    {
        public HumanLimit limit;
        public string boneName { get; set; }
        public string humanName { get; set; }
    }

    public struct HumanLimit
    {
        public bool useDefaultValues { get; set; }
    }

    public struct SkeletonBone
    {
        public string name;
        public Vector3 position;
        public Quaternion rotation;
        public Vector3 scale;
    }

    public struct HumanPose
    {
        public Vector3 bodyPosition;
        public Quaternion bodyRotation;
        public float[] muscles;
    }

    public class HumanPoseHandler : IDisposable
    {
        public HumanPoseHandler(Avatar avatar, Transform root) { }
        public void GetHumanPose(ref HumanPose humanPose) { }
        public void SetHumanPose(ref HumanPose humanPose) { }
        public void Dispose() { }
    }

    public class Animator : Behaviour
    {
        public Avatar avatar { get; set; }
    }

    public sealed class Camera : Behaviour
    {
        public static Camera main => null;
    }

    public sealed class AudioClip : Object
    {
        public int samples => 0;
        public int channels => 1;
        public int frequency => 0;
        public float length => 0;
        public bool GetData(float[] data, int offsetSamples) => false;
    }

    public sealed class AudioSource : Behaviour
    {
        public AudioClip clip { get; set; }
        public bool isPlaying => false;
        public bool loop { get; set; }
        public float volume { get; set; }
        public int timeSamples { get; set; }
        public void PlayScheduled(double time) { }
    }

    public sealed class AudioSettings
    {
        public static double dspTime => 0;
    }

    public sealed class Microphone
    {
        public static string[] devices => new string[0];
        public static AudioClip Start(string deviceName, bool loop, int lengthSec, int frequency) => null;
        public static void End(string deviceName) { }
        public static bool IsRecording(string deviceName) => false;
        public static int GetPosition(string deviceName) => 0;
    }

    public enum UserAuthorization { WebCam = 1, Microphone = 2 }

    public class Application
    {
        public static string streamingAssetsPath => "";
        public static AsyncOperation RequestUserAuthorization(UserAuthorization mode) => null;
        public static bool HasUserAuthorization(UserAuthorization mode) => false;
    }

    public class Debug
    {
        public static void LogError(object message, Object context) { }
        public static void LogWarning(object message, Object context) { }
    }

    public sealed class Screen
    {
        public static int width => 0;
    }

    public class GUI
    {
        public static void Label(Rect position, string text) { }
    }

    public class YieldInstruction { }

    public sealed class Coroutine : YieldInstruction { }

    public class AsyncOperation : YieldInstruction
    {
        public bool isDone => false;
    }

    public abstract class PropertyAttribute : Attribute { }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class TooltipAttribute : PropertyAttribute
    {
        public TooltipAttribute(string tooltip) { }
    }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class RangeAttribute : PropertyAttribute
    {
        public RangeAttribute(float min, float max) { }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class DisallowMultipleComponent : Attribute { }

    [AttributeUsage(AttributeTargets.Class, AllowMultiple = true)]
    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type requiredComponent) { }
    }

    public sealed class AddComponentMenu : Attribute
    {
        public AddComponentMenu(string menuName) { }
    }
}

namespace UnityEngine.Networking
{
    public class UnityWebRequest : IDisposable
    {
        public enum Result { InProgress, Success, ConnectionError, ProtocolError, DataProcessingError }
        public static UnityWebRequest Get(string uri) => null;
        public UnityWebRequestAsyncOperation SendWebRequest() => null;
        public Result result => Result.InProgress;
        public string error => "";
        public DownloadHandler downloadHandler => null;
        public void Dispose() { }
    }

    public class UnityWebRequestAsyncOperation : AsyncOperation { }

    public class DownloadHandler
    {
        public byte[] data => null;
    }
}
