using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;
using System.Text;

namespace Troupe
{
    /// <summary>Texts as C has them, UTF-8 with a NUL, until they are disposed of.</summary>
    internal sealed unsafe class Texts : IDisposable
    {
        private readonly List<IntPtr> kept = new List<IntPtr>();

        /// <summary>A text of this object. Null stays null.</summary>
        public byte* Of(string text)
        {
            if (text == null) return null;
            var bytes = Encoding.UTF8.GetBytes(text);
            var memory = Marshal.AllocHGlobal(bytes.Length + 1);
            kept.Add(memory);
            Marshal.Copy(bytes, 0, memory, bytes.Length);
            ((byte*)memory)[bytes.Length] = 0;
            return (byte*)memory;
        }

        public void Dispose()
        {
            foreach (var memory in kept) Marshal.FreeHGlobal(memory);
            kept.Clear();
        }

        /// <summary>A text of C as a string.</summary>
        public static string Read(byte* text)
        {
            if (text == null) return "";
            var length = 0;
            while (text[length] != 0) length++;
            return length == 0 ? "" : Encoding.UTF8.GetString(text, length);
        }

        /// <summary>Texts of C as strings.</summary>
        public static string[] Read(byte** texts, uint count)
        {
            var read = new string[count];
            for (var i = 0; i < read.Length; i++) read[i] = Read(texts[i]);
            return read;
        }
    }
}
