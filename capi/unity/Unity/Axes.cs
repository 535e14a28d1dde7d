using UnityEngine;

namespace Visavis.Unity
{
    /// <summary>The session's right-handed axes and Unity's left-handed ones: X is mirrored, so that the agent's front stays +Z.</summary>
    public static class Axes
    {
        public static Vector3 ToUnity(float x, float y, float z) => new Vector3(-x, y, z);

        public static Quaternion ToUnity(float x, float y, float z, float w) => new Quaternion(x, -y, -z, w);

        /// <summary>A position of Unity in the session's axes.</summary>
        public static Vector3 ToSession(Vector3 position) => new Vector3(-position.x, position.y, position.z);

        /// <summary>A rotation of Unity in the session's axes.</summary>
        public static Quaternion ToSession(Quaternion rotation) => new Quaternion(rotation.x, -rotation.y, -rotation.z, rotation.w);
    }
}
