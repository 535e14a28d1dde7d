using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Visavis
{
    /// <summary>A loaded bundle, shared by any number of sessions and threads. Dispose frees it; sessions made on it live on.</summary>
    /// <remarks>
    /// ArgumentException, IOException (a file that cannot be read), BundleException, ObjectDisposedException, VisavisException; DllNotFoundException
    /// where the plugin is missing.
    /// </remarks>
    public sealed class Engine : IDisposable
    {
        Engine(EngineHandle handle)
        {
            Handle = handle;
            JointCount = (int)Native.visavis_engine_joint_count(handle);
        }

        internal EngineHandle Handle { get; }

        /// <summary>Version of the library, such as "0.1.0".</summary>
        public static string Version => Errors.Text(Native.visavis_version());

        /// <summary>Loads the bundle at a path. On Android StreamingAssets lie inside the APK: read them and use FromBytes.</summary>
        public static Engine FromPath(string path)
        {
            if (path == null) throw new ArgumentNullException(nameof(path));
            // A C string would end there, and another file be read.
            if (path.IndexOf('\0') >= 0) throw new ArgumentException("a path without NUL is needed", nameof(path));
            Errors.Check(Native.visavis_check_abi(Native.AbiVersion));
            var status = Native.visavis_engine_from_path(Encoding.UTF8.GetBytes(path + "\0"), out var handle);
            return Made(status, handle);
        }

        /// <summary>Loads a bundle from memory, which is not needed afterwards.</summary>
        public static Engine FromBytes(byte[] bundle)
        {
            if (bundle == null) throw new ArgumentNullException(nameof(bundle));
            Errors.Check(Native.visavis_check_abi(Native.AbiVersion));
            var status = Native.visavis_engine_from_memory(bundle, (UIntPtr)bundle.Length, out var handle);
            return Made(status, handle);
        }

        static Engine Made(Status status, EngineHandle handle)
        {
            Errors.Check(status);
            return new Engine(handle);
        }

        /// <summary>Name of the model.</summary>
        public string Name => Errors.Text(Native.visavis_engine_name(Handle));

        /// <summary>Whether the bundle has hearing: sounds in the room are heard (Session.PushSound).</summary>
        public bool HasHearing => Native.visavis_engine_has_hearing(Handle) != 0;

        /// <summary>Joints of a frame, parents before children; 0 is the hips.</summary>
        public int JointCount { get; }

        /// <summary>VRM humanoid name of a joint, such as "leftUpperArm".</summary>
        public string JointName(int joint) => Errors.Text(Native.visavis_engine_joint_name(Handle, Number(joint)));

        /// <summary>Parent of a joint, -1 for the hips, and its offset from there in the rest pose, session axes, metres.</summary>
        public int JointParent(int joint, out float x, out float y, out float z)
        {
            var offset = new float[3];
            Errors.Check(Native.visavis_engine_joint(Handle, Number(joint), out var parent, offset));
            x = offset[0];
            y = offset[1];
            z = offset[2];
            return parent;
        }

        /// <summary>Joint that follows OpenXR's body joint (XR_FB_body_tracking, XR_META_body_tracking_full_body); -1 for the root and unknown numbers.</summary>
        public int JointForOpenXr(int openXrJoint) => openXrJoint < 0 ? -1 : Native.visavis_engine_joint_for_openxr(Handle, (uint)openXrJoint);

        uint Number(int joint)
        {
            if (joint < 0 || joint >= JointCount) throw new ArgumentOutOfRangeException(nameof(joint), joint, "0 to JointCount - 1");
            return (uint)joint;
        }

        /// <summary>The defaults, to be changed and passed to NewSession.</summary>
        public static SessionOptions Options()
        {
            Errors.Check(Native.visavis_session_options_init(out var options, (UIntPtr)Marshal.SizeOf(typeof(SessionOptions))));
            return options;
        }

        /// <summary>Starts a session with the defaults.</summary>
        public Session NewSession() => NewSession(Options());

        /// <summary>Starts a session. All its memory is taken here.</summary>
        public Session NewSession(SessionOptions options)
        {
            var status = Native.visavis_session_new(Handle, ref options, out var session);
            Errors.Check(status);
            return new Session(session, JointCount);
        }

        public void Dispose() => Handle.Dispose();
    }
}
