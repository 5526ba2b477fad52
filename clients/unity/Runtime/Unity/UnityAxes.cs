#if UNITY_5_3_OR_NEWER
using UnityEngine;

namespace Troupe
{
    /// <summary>Values of Troupe as Unity has them, and back.</summary>
    public static class UnityAxes
    {
        public static Vector3 ToUnity(this Vec3 of)
        {
            var there = Axes.Flip(of);
            return new Vector3(there.X, there.Y, there.Z);
        }

        public static Quaternion ToUnity(this Quat of)
        {
            var there = Axes.Flip(of);
            return new Quaternion(there.X, there.Y, there.Z, there.W);
        }

        public static Vec3 ToTroupe(this Vector3 of) => Axes.Flip(new Vec3(of.x, of.y, of.z));

        /// <summary>The heading of a transform, radians.</summary>
        public static float HeadingInTroupe(this Transform of) => Axes.Flip(of.eulerAngles.y * Mathf.Deg2Rad);
    }
}
#endif
