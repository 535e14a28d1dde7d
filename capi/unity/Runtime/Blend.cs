using System;

namespace Visavis
{
    /// <summary>Between two frames that follow each other.</summary>
    internal static class Blend
    {
        public static void Frames(Frame a, Frame b, double t, out Frame mixed)
        {
            mixed = t < 0.5 ? a : b;
            mixed.Time = a.Time + (b.Time - a.Time) * t;
            mixed.RootX = a.RootX + (b.RootX - a.RootX) * t;
            mixed.RootZ = a.RootZ + (b.RootZ - a.RootZ) * t;
            mixed.RootYaw = a.RootYaw + Math.IEEERemainder(b.RootYaw - a.RootYaw, 2 * Math.PI) * t;
            mixed.HipsX = Between(a.HipsX, b.HipsX, (float)t);
            mixed.HipsY = Between(a.HipsY, b.HipsY, (float)t);
            mixed.HipsZ = Between(a.HipsZ, b.HipsZ, (float)t);
        }

        public static void Joints(Joint a, Joint b, float t, out Joint mixed)
        {
            mixed = a;
            Turn(a.LocalX, a.LocalY, a.LocalZ, a.LocalW, b.LocalX, b.LocalY, b.LocalZ, b.LocalW, t,
                out mixed.LocalX, out mixed.LocalY, out mixed.LocalZ, out mixed.LocalW);
            Turn(a.RotationX, a.RotationY, a.RotationZ, a.RotationW, b.RotationX, b.RotationY, b.RotationZ, b.RotationW, t,
                out mixed.RotationX, out mixed.RotationY, out mixed.RotationZ, out mixed.RotationW);
            mixed.PositionX = Between(a.PositionX, b.PositionX, t);
            mixed.PositionY = Between(a.PositionY, b.PositionY, t);
            mixed.PositionZ = Between(a.PositionZ, b.PositionZ, t);
        }

        static float Between(float a, float b, float t) => a + (b - a) * t;

        // The chord, brought back to length 1: a thirtieth of a second apart, the arc differs by nothing that can be seen.
        static void Turn(float ax, float ay, float az, float aw, float bx, float by, float bz, float bw, float t,
            out float x, out float y, out float z, out float w)
        {
            var sign = ax * bx + ay * by + az * bz + aw * bw < 0 ? -1f : 1f;
            x = Between(ax, sign * bx, t);
            y = Between(ay, sign * by, t);
            z = Between(az, sign * bz, t);
            w = Between(aw, sign * bw, t);
            var length = (float)Math.Sqrt(x * x + y * y + z * z + w * w);
            x /= length;
            y /= length;
            z /= length;
            w /= length;
        }
    }
}
