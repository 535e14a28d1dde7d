using System;
using System.Runtime.InteropServices;

namespace Visavis
{
    /// <summary>An engine of the library. Calls keep it alive: disposing while another thread is in a call frees when that call is over.</summary>
    internal sealed class EngineHandle : SafeHandle
    {
        public EngineHandle() : base(IntPtr.Zero, true) { }

        public override bool IsInvalid => handle == IntPtr.Zero;

        protected override bool ReleaseHandle()
        {
            Native.visavis_engine_free(handle);
            return true;
        }
    }

    /// <summary>A session of the library; see EngineHandle.</summary>
    internal sealed class SessionHandle : SafeHandle
    {
        public SessionHandle() : base(IntPtr.Zero, true) { }

        public override bool IsInvalid => handle == IntPtr.Zero;

        protected override bool ReleaseHandle()
        {
            Native.visavis_session_free(handle);
            return true;
        }
    }
}
