using System;
using Troupe.Native;

namespace Troupe
{
    /// <summary>A pack of a server on one skeleton.</summary>
    public sealed unsafe class Pack : IDisposable
    {
        private TroupePack handle;

        internal Pack(TroupePack opened)
        {
            handle = opened;
            var info = new TroupePackInfo { size = (uint)sizeof(TroupePackInfo) };
            TroupeException.Check(Api.troupe_pack_info(handle, &info));
            Name = Texts.Read(info.name);
            Version = Texts.Read(info.version);
            Licence = Texts.Read(info.licence);
            Joints = Texts.Read(info.joint_names, info.joint_count);
            Parents = new int[info.joint_count];
            Offsets = new Vec3[info.joint_count];
            for (var i = 0; i < Parents.Length; i++)
            {
                Parents[i] = info.joint_parents[i];
                var offset = info.joint_offsets + 3 * i;
                Offsets[i] = new Vec3(offset[0], offset[1], offset[2]);
            }
            Contacts = Texts.Read(info.contact_names, info.contact_count);
            Styles = Texts.Read(info.style_names, info.style_count);
            DefaultStyle = Texts.Read(info.default_style);
            Skills = Texts.Read(info.skill_names, info.skill_count);
        }

        public string Name { get; }
        public string Version { get; }
        /// <summary>Licence of the weights.</summary>
        public string Licence { get; }
        /// <summary>Names of the joints, parents before children; frames use this order.</summary>
        public string[] Joints { get; }
        /// <summary>Index of each joint's parent; -1 for the first.</summary>
        public int[] Parents { get; }
        /// <summary>Offset of each joint from its parent while no joint turns, metres.</summary>
        public Vec3[] Offsets { get; }
        /// <summary>Names of the contact joints, in the order of a frame's bits.</summary>
        public string[] Contacts { get; }
        public string[] Styles { get; }
        /// <summary>The style of characters that name none.</summary>
        public string DefaultStyle { get; }
        public string[] Skills { get; }

        /// <summary>Opens a crowd, all characters or none.</summary>
        public Crowd OpenCrowd(CrowdOptions options, params Character[] characters)
        {
            if (characters.Length == 0) throw new ArgumentException("must have a character", "characters");
            options = options ?? new CrowdOptions();
            using (var texts = new Texts())
            {
                var array = new TroupeCharacter[characters.Length];
                for (var i = 0; i < array.Length; i++)
                {
                    array[i] = new TroupeCharacter
                    {
                        seed = characters[i].Seed,
                        position = characters[i].Position.ToNative(),
                        heading = characters[i].Heading,
                        style = texts.Of(characters[i].Style),
                    };
                }
                fixed (TroupeCharacter* first = array)
                {
                    var reconnect = Connection.Milliseconds(options.Reconnect);
                    var never = options.Reconnect != null && options.Reconnect.Value <= TimeSpan.Zero;
                    var native = new TroupeCrowdOptions
                    {
                        size = (uint)sizeof(TroupeCrowdOptions),
                        clock = (uint)options.Clock,
                        rate_hz = (uint)options.RateHz,
                        rotation = (uint)TroupeRotation.Quaternion,
                        joint_positions = options.JointPositions ? 1u : 0u,
                        ttl_ms = Connection.Milliseconds(options.TimeToLive),
                        reconnect_ms = never ? Api.TROUPE_NEVER : reconnect,
                        character_count = (uint)array.Length,
                        character_size = (uint)sizeof(TroupeCharacter),
                        characters = first,
                        scene = texts.Of(options.Scene),
                    };
                    TroupeCrowd opened;
                    TroupeException.Check(Api.troupe_crowd_open(handle, &native, &opened));
                    return new Crowd(opened);
                }
            }
        }

        /// <summary>Closes the pack; its crowds stay open. A second call does nothing.</summary>
        public void Dispose()
        {
            if (handle.id == 0) return;
            Api.troupe_pack_close(handle);
            handle = default(TroupePack);
        }
    }
}
