// The functions of visavis.h. capi/tests/layout.rs compares them with the header.
using System;
using System.Runtime.InteropServices;

namespace Visavis
{
    internal static class Native
    {
        // visavis.dll, libvisavis.so: what package.sh puts into the plugin folders.
        const string Library = "visavis";
        public const uint AbiVersion = 0x10003;

        [DllImport(Library)] public static extern uint visavis_abi_version();
        [DllImport(Library)] public static extern Status visavis_check_abi(uint abiVersion);
        [DllImport(Library)] public static extern IntPtr visavis_version();
        [DllImport(Library)] public static extern IntPtr visavis_last_error();
        [DllImport(Library)] public static extern uint visavis_current_thread_id();
        [DllImport(Library)] public static extern Status visavis_pin_current_thread(ulong mask);
        [DllImport(Library)] public static extern Status visavis_engine_from_path([In] byte[] utf8Path, out EngineHandle engine);
        [DllImport(Library)] public static extern Status visavis_engine_from_fd(int fd, ulong offset, ulong length, out EngineHandle engine);
        [DllImport(Library)] public static extern Status visavis_engine_from_memory([In] byte[] bytes, UIntPtr length, out EngineHandle engine);
        [DllImport(Library)] public static extern void visavis_engine_free(IntPtr engine);
        [DllImport(Library)] public static extern IntPtr visavis_engine_name(EngineHandle engine);
        [DllImport(Library)] public static extern int visavis_engine_has_hearing(EngineHandle engine);
        [DllImport(Library)] public static extern uint visavis_engine_joint_count(EngineHandle engine);
        [DllImport(Library)] public static extern IntPtr visavis_engine_joint_name(EngineHandle engine, uint joint);
        [DllImport(Library)] public static extern Status visavis_engine_joint(EngineHandle engine, uint joint, out int parent, [Out] float[] offset);
        [DllImport(Library)] public static extern int visavis_engine_openxr_joint(EngineHandle engine, uint joint, int body);
        [DllImport(Library)] public static extern int visavis_engine_joint_for_openxr(EngineHandle engine, uint openXrJoint);
        [DllImport(Library)] public static extern Status visavis_session_options_init(out SessionOptions options, UIntPtr structSize);
        [DllImport(Library)] public static extern Status visavis_session_new(EngineHandle engine, ref SessionOptions options, out SessionHandle session);
        [DllImport(Library)] public static extern void visavis_session_free(IntPtr session);
        [DllImport(Library)] public static extern Status visavis_session_push_agent_audio(SessionHandle session, IntPtr samples, UIntPtr count, uint rate);
        [DllImport(Library)] public static extern Status visavis_session_push_user_audio(SessionHandle session, IntPtr samples, UIntPtr count, uint rate);
        [DllImport(Library)] public static extern Status visavis_session_finish_audio(SessionHandle session, int voice);
        [DllImport(Library)] public static extern Status visavis_session_clear_audio(SessionHandle session, int voice);
        [DllImport(Library)] public static extern Status visavis_session_set_audio_present(SessionHandle session, int voice, int present);
        [DllImport(Library)] public static extern Status visavis_session_push_user_head(SessionHandle session, float x, float y, float z, double time);
        [DllImport(Library)] public static extern Status visavis_session_push_user_pose(SessionHandle session, float x, float y, float z, float qx, float qy, float qz, float qw, double time);
        [DllImport(Library)] public static extern Status visavis_session_dyadic(SessionHandle session, [Out] float[] shares, UIntPtr capacity, out UIntPtr count);
        [DllImport(Library)] public static extern Status visavis_session_push_sound(SessionHandle session, uint id, IntPtr samples, UIntPtr count, uint rate, float x, float y, float z);
        [DllImport(Library)] public static extern Status visavis_session_end_sound(SessionHandle session, uint id);
        [DllImport(Library)] public static extern Status visavis_session_push_ears(SessionHandle session, IntPtr left, IntPtr right, UIntPtr count, uint rate);
        [DllImport(Library)] public static extern Status visavis_session_end_ears(SessionHandle session);
        [DllImport(Library)] public static extern Status visavis_session_heard_place(SessionHandle session, [Out] float[] position, out int known);
        [DllImport(Library)] public static extern Status visavis_session_set_sensitivity(SessionHandle session, float sensitivity);
        [DllImport(Library)] public static extern Status visavis_session_set_gaze(SessionHandle session, float target);
        [DllImport(Library)] public static extern Status visavis_session_set_natural_gaze(SessionHandle session);
        [DllImport(Library)] public static extern Status visavis_session_set_guidance(SessionHandle session, float weight, float gaze);
        [DllImport(Library)] public static extern Status visavis_session_set_sampler(SessionHandle session, int kind, uint steps);
        [DllImport(Library)] public static extern Status visavis_session_set_budget(SessionHandle session, float milliseconds);
        [DllImport(Library)] public static extern Status visavis_session_set_fallback(SessionHandle session, EngineHandle engine);
        [DllImport(Library)] public static extern Status visavis_session_report_block_time(SessionHandle session, double milliseconds);
        [DllImport(Library)] public static extern Status visavis_session_poll(SessionHandle session, double now, [Out] Frame[] frames, UIntPtr frameSize, [Out] Joint[] joints, UIntPtr jointCapacity, out uint frameCount);
        [DllImport(Library)] public static extern Status visavis_session_next_due(SessionHandle session, out double time);
        [DllImport(Library)] public static extern Status visavis_session_reset(SessionHandle session);
        [DllImport(Library)] public static extern Status visavis_session_warm_up(SessionHandle session, uint blocks);
        [DllImport(Library)] public static extern Status visavis_session_worker_thread_ids(SessionHandle session, [Out] uint[] ids, UIntPtr capacity, out UIntPtr count);
        [DllImport(Library)] public static extern Status visavis_session_stats(SessionHandle session, ref Stats stats);
    }
}
