using System;
using Troupe.Native;

namespace Troupe
{
    /// <summary>
    /// Frames of a crowd, in the library's memory: nothing is copied. They hold until the next read or step of the crowd;
    /// then every use throws.
    /// </summary>
    public unsafe struct Frames
    {
        private readonly Crowd crowd;
        private readonly long stamp;
        private readonly TroupeFrames frames;

        internal Frames(Crowd crowd, TroupeFrames frames)
        {
            this.crowd = crowd;
            this.frames = frames;
            stamp = crowd.Stamp;
        }

        /// <summary>Characters of the crowd.</summary>
        public int CharacterCount => (int)frames.character_count;
        /// <summary>Frames of each character.</summary>
        public int FrameCount => (int)frames.frame_count;
        public int JointCount => (int)frames.joint_count;
        /// <summary>Number of the tick or step, from 0.</summary>
        public long Tick => (long)frames.tick;
        /// <summary>Ticks so far that were not read, because newer ones had come.</summary>
        public long MissedTicks => (long)frames.missed_ticks;

        /// <summary>Whether a character has frames here.</summary>
        public bool IsPresent(int character)
        {
            Row(character, 0);
            return frames.present[character] != 0;
        }

        /// <summary>Number of a character's first frame on its timeline, which has 30 frames a second.</summary>
        public long FirstFrame(int character)
        {
            Row(character, 0);
            return (long)frames.first_frames[character];
        }

        /// <summary>Position of the first joint in the world.</summary>
        public Vec3 Root(int character, int frame = 0)
        {
            var at = frames.root_positions + 3 * Row(character, frame);
            return new Vec3(at[0], at[1], at[2]);
        }

        /// <summary>Rotation of a joint: of the first in the world, of the others relative to their parents.</summary>
        public Quat Rotation(int character, int joint, int frame = 0)
        {
            var at = frames.rotations + 4 * Joint(character, joint, frame);
            return new Quat(at[0], at[1], at[2], at[3]);
        }

        /// <summary>Position of a joint in the world, if the options of the crowd ask for them.</summary>
        public Vec3 JointPosition(int character, int joint, int frame = 0)
        {
            var index = Joint(character, joint, frame);
            if (frames.joint_positions == null)
            {
                throw new InvalidOperationException("set CrowdOptions.JointPositions to have the joints' positions");
            }
            var at = frames.joint_positions + 3 * index;
            return new Vec3(at[0], at[1], at[2]);
        }

        /// <summary>Whether the n-th contact joint of the pack is on the ground.</summary>
        public bool IsDown(int character, int contact, int frame = 0)
        {
            return contact < 8 && (frames.contacts[Row(character, frame)] >> contact & 1) == 1;
        }

        private long Row(int character, int frame)
        {
            if (crowd == null || stamp != crowd.Stamp)
            {
                throw new InvalidOperationException("these frames are no more: a newer read, step or Dispose came");
            }
            if (character < 0 || character >= CharacterCount) throw Outside("character", CharacterCount);
            if (frame < 0 || frame >= FrameCount) throw Outside("frame", FrameCount);
            return (long)character * FrameCount + frame;
        }

        private long Joint(int character, int joint, int frame)
        {
            if (joint < 0 || joint >= JointCount) throw Outside("joint", JointCount);
            return Row(character, frame) * JointCount + joint;
        }

        private static Exception Outside(string name, int count)
        {
            return new ArgumentOutOfRangeException(name, string.Format("must be 0 to {0}", count - 1));
        }
    }
}
