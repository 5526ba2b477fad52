using System;
using System.Collections.Generic;
using Troupe.Native;

namespace Troupe
{
    /// <summary>Three numbers in Troupe's frame of reference: X left, Y up, Z ahead, right-handed, metres.</summary>
    public struct Vec3
    {
        public readonly float X, Y, Z;

        public Vec3(float x, float y, float z)
        {
            X = x;
            Y = y;
            Z = z;
        }

        public override string ToString() => string.Format("({0:0.000}, {1:0.000}, {2:0.000})", X, Y, Z);

        internal TroupeVec3 ToNative() => new TroupeVec3 { x = X, y = Y, z = Z };
    }

    /// <summary>A rotation as a unit quaternion, in Troupe's frame of reference.</summary>
    public struct Quat
    {
        public readonly float X, Y, Z, W;

        public Quat(float x, float y, float z, float w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }
    }

    /// <summary>How to connect. What is not set takes its default.</summary>
    public sealed class ConnectOptions
    {
        /// <summary>Time to open the connection. Default: 5 s.</summary>
        public TimeSpan? ConnectTimeout;
        /// <summary>Time for one call. Default: 60 s.</summary>
        public TimeSpan? RequestTimeout;
        /// <summary>Key of the client, if the server asks for one.</summary>
        public string Key;
        /// <summary>File (PEM) with the authorities to trust. Default: those of the system.</summary>
        public string CaFile;
        /// <summary>File (PEM) with the client's certificate, for a server that asks for one.</summary>
        public string CertificateFile;
        /// <summary>File (PEM) with the private key of the certificate.</summary>
        public string KeyFile;
    }

    /// <summary>A character of a new crowd.</summary>
    public struct Character
    {
        /// <summary>The same seed, commands and steps give the same frames.</summary>
        public ulong Seed;
        /// <summary>Where it stands at first.</summary>
        public Vec3 Position;
        /// <summary>What it faces at first, radians: 0 is +Z, a quarter turn is +X.</summary>
        public float Heading;
        /// <summary>Its first style. Null: the pack's.</summary>
        public string Style;
    }

    /// <summary>What a crowd is opened with. What is not set takes its default.</summary>
    public sealed class CrowdOptions
    {
        /// <summary>Who advances the characters. Default: the server.</summary>
        public TroupeClock Clock = TroupeClock.Server;
        /// <summary>Frames a second: 30, 50 or 60.</summary>
        public int RateHz = 30;
        /// <summary>Whether frames have the joints' positions in the world, too.</summary>
        public bool JointPositions;
        /// <summary>Time without a step or stream after which the server closes a character. Default: a minute.</summary>
        public TimeSpan? TimeToLive;
        /// <summary>
        /// Time for which a connection that breaks is opened again. Default: 10 s. Zero: the crowd ends when the
        /// connection breaks.
        /// </summary>
        public TimeSpan? Reconnect;
        /// <summary>Name of the scene on the server. Null: none, flat ground.</summary>
        public string Scene;
    }

    /// <summary>How to move over the ground. The default value stands.</summary>
    public struct Locomotion
    {
        /// <summary>Velocity over the ground, metres a second in the world. Zero: stand.</summary>
        public Vec3 Velocity;
        /// <summary>What to face, radians. Null: the way it goes.</summary>
        public float? Facing;
        /// <summary>Height of the first joint, metres, for styles that have a range of heights.</summary>
        public float? Height;
        /// <summary>Style to move in. Null: the current one.</summary>
        public string Style;
        /// <summary>The only gait of the style to use. Null: those that suit the velocity.</summary>
        public string Gait;
    }

    /// <summary>A point of a path.</summary>
    public struct PathPoint
    {
        /// <summary>Place to pass. Its height is ignored.</summary>
        public Vec3 Position;
        /// <summary>What to face there, radians. Null: along the path.</summary>
        public float? Heading;
        /// <summary>Time of arrival, seconds from the command: for all points or none.</summary>
        public float? Time;
    }

    /// <summary>Something that happened to a character. TroupeNoteKind has the meaning of each part.</summary>
    public sealed class Note
    {
        /// <summary>What it is about.</summary>
        public TroupeNoteKind Kind { get; internal set; }
        /// <summary>Index of the character; -1 for the whole crowd.</summary>
        public int Character { get; internal set; }
        /// <summary>Frame of the character's timeline, which has 30 frames a second.</summary>
        public long Frame { get; internal set; }
        /// <summary>Notes that were dropped so far, because they were not taken.</summary>
        public long Dropped { get; internal set; }
        public string Subject { get; internal set; }
        public string Detail { get; internal set; }
        public string Message { get; internal set; }
        public IReadOnlyList<float> Values { get; internal set; }
    }
}
