using System;
using System.Globalization;
using System.Text;

namespace Troupe
{
    /// <summary>
    /// The joints of a character of your own, for the server to answer on: PUT ToJson to /v1/skeletons/NAME, then open a
    /// pack with that skeleton. The joints keep the axes that they have in Unity, so the rotations of frames, flipped, are
    /// their local rotations.
    /// </summary>
    public sealed class Rig
    {
        private readonly string[] names;
        private readonly int[] parents;
        private readonly Vec3[] positions;
        private readonly Quat[] rotations;

        /// <summary>
        /// Joints, parents before children, in a pose on two feet that faces Unity's +Z, with arms that hang or point to
        /// the sides: places (metres) and rotations in Unity's world.
        /// </summary>
        public Rig(string[] names, int[] parents, Vec3[] positions, Quat[] rotations)
        {
            if (parents.Length != names.Length || positions.Length != names.Length || rotations.Length != names.Length)
            {
                throw new ArgumentException(string.Format("must have {0} elements, one for each name", names.Length));
            }
            for (var i = 0; i < parents.Length; i++)
            {
                if (parents[i] >= i || parents[i] < (i == 0 ? -1 : 0))
                {
                    throw new ArgumentException(string.Format("{0} must come after its parent", names[i]), "parents");
                }
            }
            this.names = names;
            this.parents = parents;
            this.positions = positions;
            this.rotations = rotations;
        }

        /// <summary>The body of the request.</summary>
        public string ToJson()
        {
            var json = new StringBuilder("{\"joints\":{\"joints\":[");
            for (var i = 0; i < names.Length; i++)
            {
                var parent = parents[i];
                var offset = parent < 0 ? default(Vec3) : Into(rotations[parent], Less(positions[i], positions[parent]));
                var there = Axes.Flip(offset);
                json.Append(i == 0 ? "{\"name\":" : ",{\"name\":").Append(Quoted(names[i]));
                if (parent >= 0) json.Append(",\"parent\":").Append(Quoted(names[parent]));
                json.Append(",\"offset\":{\"x\":").Append(Number(there.X)).Append(",\"y\":").Append(Number(there.Y));
                json.Append(",\"z\":").Append(Number(there.Z)).Append("}}");
            }
            json.Append("],\"neutral\":[");
            for (var i = 0; i < names.Length; i++)
            {
                var there = Axes.Flip(rotations[i]);
                json.Append(i == 0 ? "{\"w\":" : ",{\"w\":").Append(Number(there.W));
                json.Append(",\"x\":").Append(Number(there.X)).Append(",\"y\":").Append(Number(there.Y));
                json.Append(",\"z\":").Append(Number(there.Z)).Append("}");
            }
            return json.Append("]}}").ToString();
        }

        private static Vec3 Less(Vec3 a, Vec3 b) => new Vec3(a.X - b.X, a.Y - b.Y, a.Z - b.Z);

        /// <summary>A vector of the world in a turned frame.</summary>
        private static Vec3 Into(Quat frame, Vec3 v)
        {
            // v + 2 u x (u x v - w v), with u of the inverse: the negative axis.
            float x = -frame.X, y = -frame.Y, z = -frame.Z, w = frame.W;
            float cx = y * v.Z - z * v.Y + w * v.X, cy = z * v.X - x * v.Z + w * v.Y, cz = x * v.Y - y * v.X + w * v.Z;
            return new Vec3(
                v.X + 2 * (y * cz - z * cy),
                v.Y + 2 * (z * cx - x * cz),
                v.Z + 2 * (x * cy - y * cx));
        }

        private static string Number(float of) => of.ToString("R", CultureInfo.InvariantCulture);

        private static string Quoted(string text)
        {
            var quoted = new StringBuilder("\"");
            foreach (var letter in text)
            {
                if (letter == '"' || letter == '\\') quoted.Append('\\').Append(letter);
                else if (letter < ' ') quoted.AppendFormat("\\u{0:x4}", (int)letter);
                else quoted.Append(letter);
            }
            return quoted.Append('"').ToString();
        }
    }
}
