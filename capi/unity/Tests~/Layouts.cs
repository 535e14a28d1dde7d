using System;
using System.Collections.Generic;
using System.IO;
using System.Runtime.InteropServices;

namespace Visavis.Tests
{
    /// <summary>Sizes and offsets as a C compiler gives them for the header (layouts.py), field by field, and none missing on either side.</summary>
    internal static class Layouts
    {
        public static void AreTheHeaders(string file)
        {
            var here = new SortedDictionary<string, int>(StringComparer.Ordinal);
            foreach (var type in new[] { typeof(SessionOptions), typeof(Frame), typeof(Joint), typeof(VoiceStats), typeof(Stats) })
            {
                here[type.Name] = Marshal.SizeOf(type);
                foreach (var field in type.GetFields())
                    here[type.Name + "." + field.Name] = (int)Marshal.OffsetOf(type, field.Name);
            }
            var there = new SortedDictionary<string, int>(StringComparer.Ordinal);
            foreach (var line in File.ReadAllLines(file))
            {
                var words = line.Split(' ');
                there[words[0]] = int.Parse(words[1]);
            }
            foreach (var pair in there)
                Check.That(here.TryGetValue(pair.Key, out var value) && value == pair.Value, "layout of " + pair.Key + ": " + pair.Value + " in C");
            Check.That(here.Count == there.Count && there.Count > 80, "fields: " + here.Count + " in C#, " + there.Count + " in C");
        }
    }
}
