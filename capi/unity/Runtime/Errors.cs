using System;
using System.IO;
using System.Runtime.InteropServices;
using System.Text;

namespace Visavis
{
    /// <summary>A fault of the library, or a library that does not fit this package; Message says what to do.</summary>
    public class VisavisException : Exception
    {
        public VisavisException(Status status, string message) : base(message) { Status = status; }

        public Status Status { get; }
    }

    /// <summary>A bundle that is damaged, of another format, or whose parts disagree: Status tells which.</summary>
    public sealed class BundleException : VisavisException
    {
        public BundleException(Status status, string message) : base(status, message) { }
    }

    /// <summary>Another thread is inside this session: Poll, Reset, WarmUp, SetFallback and Statistics are one thread's at a time. Never thrown by pushes and settings.</summary>
    public sealed class BusyException : InvalidOperationException
    {
        public BusyException(string message) : base(message) { }
    }

    internal static class Errors
    {
        /// <summary>Turns a status into the exception that stands for it. Before any other call of the library by this thread.</summary>
        public static void Check(Status status)
        {
            if (status != Status.Ok) throw Of(status, Text(Native.visavis_last_error()));
        }

        static Exception Of(Status status, string message)
        {
            switch (status)
            {
                case Status.Argument:
                case Status.Audio:
                    return new ArgumentException(message);
                case Status.Io:
                    return new IOException(message);
                case Status.BundleCorrupt:
                case Status.BundleVersion:
                case Status.BundleInvalid:
                    return new BundleException(status, message);
                case Status.State:
                    return new InvalidOperationException(message);
                case Status.Busy:
                    return new BusyException(message);
                default:
                    return new VisavisException(status, message);
            }
        }

        /// <summary>A C string in UTF-8; null for a null pointer.</summary>
        public static string Text(IntPtr text)
        {
            if (text == IntPtr.Zero) return null;
            int length = 0;
            while (Marshal.ReadByte(text, length) != 0) length++;
            var bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }
    }
}
