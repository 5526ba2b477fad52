namespace Troupe
{
    /// <summary>
    /// From Troupe's frame of reference (right-handed, X left, Y up, Z ahead) to Unity's (left-handed, X right, Y up, Z
    /// ahead) and back. Both are in metres. The same functions go both ways. clients/conventions/poses.json has poses in
    /// both.
    /// </summary>
    public static class Axes
    {
        /// <summary>A position, offset or velocity in the other frame.</summary>
        public static Vec3 Flip(Vec3 of) => new Vec3(-of.X, of.Y, of.Z);

        /// <summary>A rotation in the other frame, relative to the world or to a parent.</summary>
        public static Quat Flip(Quat of) => new Quat(of.X, -of.Y, -of.Z, of.W);

        /// <summary>A heading in radians in the other frame: to the left here, to the right there.</summary>
        public static float Flip(float heading) => -heading;
    }
}
