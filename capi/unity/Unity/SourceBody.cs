using System;
using System.Collections.Generic;
using UnityEngine;

namespace Visavis.Unity
{
    /// <summary>The engine's skeleton as transforms in its rest pose, which is a T-pose without rotations, with a Humanoid avatar of its own: what poses come from.</summary>
    public sealed class SourceBody : IDisposable
    {
        readonly GameObject root;
        readonly Transform[] joints;
        readonly Avatar avatar;

        public SourceBody(Engine engine, Transform parent)
        {
            root = new GameObject("Visavis body");
            root.transform.SetParent(parent, false);
            joints = new Transform[engine.JointCount];
            var human = new List<HumanBone>();
            var skeleton = new List<SkeletonBone> { Bone(root.transform) };
            for (int j = 0; j < joints.Length; j++)
            {
                var name = engine.JointName(j);
                var above = engine.JointParent(j, out var x, out var y, out var z);
                joints[j] = new GameObject(name).transform;
                joints[j].SetParent(above < 0 ? root.transform : joints[above], false);
                joints[j].localPosition = Axes.ToUnity(x, y, z);
                skeleton.Add(Bone(joints[j]));
                // VRM's names are Mecanim's, but for the first letter.
                var bone = new HumanBone { boneName = name, humanName = char.ToUpperInvariant(name[0]) + name.Substring(1) };
                bone.limit.useDefaultValues = true;
                human.Add(bone);
            }
            var description = new HumanDescription
            {
                human = human.ToArray(),
                skeleton = skeleton.ToArray(),
                upperArmTwist = 0.5f,
                lowerArmTwist = 0.5f,
                upperLegTwist = 0.5f,
                lowerLegTwist = 0.5f,
                armStretch = 0.05f,
                legStretch = 0.05f,
            };
            avatar = AvatarBuilder.BuildHumanAvatar(root, description);
            if (!avatar.isValid || !avatar.isHuman)
                throw new InvalidOperationException("Unity takes the bundle's skeleton for no Humanoid: use a bundle with VRM's joint names");
        }

        public Transform Root => root.transform;

        public Avatar Avatar => avatar;

        /// <summary>Takes a pose of MotionThread.Sample.</summary>
        public void Show(Frame frame, Joint[] pose)
        {
            joints[0].localPosition = Axes.ToUnity(frame.HipsX, frame.HipsY, frame.HipsZ);
            for (int j = 0; j < joints.Length; j++)
                joints[j].localRotation = Axes.ToUnity(pose[j].LocalX, pose[j].LocalY, pose[j].LocalZ, pose[j].LocalW);
        }

        /// <summary>A sphere at each joint, for scenes without an avatar.</summary>
        public void AddSpheres()
        {
            foreach (var joint in joints)
            {
                var sphere = GameObject.CreatePrimitive(PrimitiveType.Sphere).transform;
                sphere.SetParent(joint, false);
                sphere.localScale = Vector3.one * (joint.name == "head" ? 0.2f : 0.09f);
            }
        }

        public void Dispose()
        {
            UnityEngine.Object.Destroy(avatar);
            UnityEngine.Object.Destroy(root);
        }

        static SkeletonBone Bone(Transform transform) => new SkeletonBone
        {
            name = transform.name,
            position = transform.localPosition,
            rotation = transform.localRotation,
            scale = Vector3.one,
        };
    }
}
