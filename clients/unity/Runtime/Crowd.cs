using System;
using Troupe.Native;

namespace Troupe
{
    /// <summary>
    /// Characters that move together. Commands may come from any thread; all else must come from one thread at a time.
    /// Reading and moving allocate nothing, if no style is named. Dispose of it, or the characters stay on the server until
    /// their time to live is over.
    /// </summary>
    public sealed unsafe class Crowd : IDisposable
    {
        private TroupeCrowd handle;
        private TroupeFrames frames;

        internal Crowd(TroupeCrowd opened)
        {
            handle = opened;
        }

        /// <summary>Counts reads and steps: frames of an older one must not be used.</summary>
        internal long Stamp { get; private set; }

        /// <summary>
        /// The newest frames, if they are newer than those of the last read. It waits for them at most as long as
        /// <paramref name="waitMs"/>.
        /// </summary>
        public bool TryRead(out Frames newest, int waitMs = 0)
        {
            var read = new TroupeFrames { size = (uint)sizeof(TroupeFrames) };
            Stamp++;
            var status = TroupeException.Check(Api.troupe_crowd_read(handle, (uint)Math.Max(0, waitMs), &read));
            frames = read;
            newest = new Frames(this, frames);
            return status == TroupeStatus.Ok;
        }

        /// <summary>On the caller's clock: the next 1 to 120 frames of all characters.</summary>
        public Frames Step(int count = 1)
        {
            var read = new TroupeFrames { size = (uint)sizeof(TroupeFrames) };
            Stamp++;
            TroupeException.Check(Api.troupe_crowd_step(handle, (uint)Math.Max(0, count), &read));
            frames = read;
            return new Frames(this, frames);
        }

        /// <summary>The oldest note that waits.</summary>
        public bool TryNote(out Note note)
        {
            note = null;
            var taken = new TroupeNote { size = (uint)sizeof(TroupeNote) };
            var status = TroupeException.Check(Api.troupe_crowd_note(handle, &taken));
            if (status != TroupeStatus.Ok) return false;
            note = new Note
            {
                Kind = taken.kind,
                Character = taken.character == Api.TROUPE_NO_CHARACTER ? -1 : (int)taken.character,
                Frame = (long)taken.frame,
                Dropped = (long)taken.dropped,
                Subject = Texts.Read(taken.subject),
                Detail = Texts.Read(taken.detail),
                Message = Texts.Read(taken.message),
                Values = new[] { taken.values[0], taken.values[1] },
            };
            return true;
        }

        /// <summary>Has a character move. Of several calls the newest counts, and only changes are sent.</summary>
        public void Move(int character, Locomotion locomotion)
        {
            using (var texts = locomotion.Style == null && locomotion.Gait == null ? null : new Texts())
            {
                var native = new TroupeLocomotion
                {
                    size = (uint)sizeof(TroupeLocomotion),
                    set = (locomotion.Facing == null ? 0 : Api.TROUPE_SET_FACING)
                        | (locomotion.Height == null ? 0 : Api.TROUPE_SET_HEIGHT),
                    velocity = locomotion.Velocity.ToNative(),
                    facing = locomotion.Facing.GetValueOrDefault(),
                    height = locomotion.Height.GetValueOrDefault(),
                    style = texts == null ? null : texts.Of(locomotion.Style),
                    gait = texts == null ? null : texts.Of(locomotion.Gait),
                };
                TroupeException.Check(Api.troupe_crowd_move(handle, (uint)character, &native));
            }
        }

        /// <summary>Has a character stand.</summary>
        public void Stand(int character) => TroupeException.Check(Api.troupe_crowd_stand(handle, (uint)character));

        /// <summary>Has a character follow a path, which begins at most 5 m away. Zero: the style's speed.</summary>
        public void FollowPath(int character, PathPoint[] points, float speed = 0, string style = null, bool loop = false)
        {
            var array = new TroupePathPoint[points.Length];
            for (var i = 0; i < array.Length; i++)
            {
                array[i] = new TroupePathPoint
                {
                    position = points[i].Position.ToNative(),
                    heading = points[i].Heading.GetValueOrDefault(),
                    time_s = points[i].Time.GetValueOrDefault(),
                    set = (points[i].Heading == null ? 0 : Api.TROUPE_SET_HEADING)
                        | (points[i].Time == null ? 0 : Api.TROUPE_SET_TIME),
                };
            }
            using (var texts = new Texts())
            fixed (TroupePathPoint* first = array)
            {
                var path = new TroupePath
                {
                    size = (uint)sizeof(TroupePath),
                    point_count = (uint)array.Length,
                    point_size = (uint)sizeof(TroupePathPoint),
                    speed = speed,
                    is_loop = loop ? 1u : 0u,
                    points = first,
                    style = texts.Of(style),
                };
                TroupeException.Check(Api.troupe_crowd_follow_path(handle, (uint)character, &path));
            }
        }

        /// <summary>Has a character go straight to a place and stand there. Zero: the style's speed.</summary>
        public void GoTo(int character, Vec3 position, float speed = 0, string style = null)
        {
            using (var texts = new Texts())
            {
                TroupeException.Check(Api.troupe_crowd_go_to(
                    handle, (uint)character, position.ToNative(), speed, texts.Of(style)));
            }
        }

        /// <summary>Has a character go to an object of its scene and use it.</summary>
        public void Interact(int character, string thing, string variant = null, string approach = null)
        {
            using (var texts = new Texts())
            {
                TroupeException.Check(Api.troupe_crowd_interact(
                    handle, (uint)character, texts.Of(thing), texts.Of(variant), texts.Of(approach)));
            }
        }

        /// <summary>Has a character do a skill of its pack where it stands.</summary>
        public void Skill(int character, string name, string variant = null)
        {
            using (var texts = new Texts())
            {
                TroupeException.Check(Api.troupe_crowd_skill(
                    handle, (uint)character, texts.Of(name), texts.Of(variant)));
            }
        }

        /// <summary>Has a character act out a sentence. Zero seconds: the model decides.</summary>
        public void Perform(int character, string text, float seconds = 0, string pack = null, float? temperature = null)
        {
            using (var texts = new Texts())
            {
                var performance = new TroupePerformance
                {
                    size = (uint)sizeof(TroupePerformance),
                    set = temperature == null ? 0 : Api.TROUPE_SET_TEMPERATURE,
                    text = texts.Of(text),
                    pack = texts.Of(pack),
                    seconds = seconds,
                    temperature = temperature.GetValueOrDefault(),
                };
                TroupeException.Check(Api.troupe_crowd_perform(handle, (uint)character, &performance));
            }
        }

        /// <summary>Has a character leave what it holds, such as a seat.</summary>
        public void EndInteraction(int character) =>
            TroupeException.Check(Api.troupe_crowd_end_interaction(handle, (uint)character));

        /// <summary>Has a character stop everything at once.</summary>
        public void Cancel(int character) => TroupeException.Check(Api.troupe_crowd_cancel(handle, (uint)character));

        /// <summary>Has a character put down what is in its hand.</summary>
        public void Drop(int character) => TroupeException.Check(Api.troupe_crowd_drop(handle, (uint)character));

        /// <summary>How much a character matters under load, 0 to 1.</summary>
        public void SetPriority(int character, float priority) =>
            TroupeException.Check(Api.troupe_crowd_set_priority(handle, (uint)character, priority));

        /// <summary>Closes the crowd, and its characters on the server. A second call does nothing.</summary>
        public void Dispose()
        {
            if (handle.id == 0) return;
            Stamp++;
            var closed = Api.troupe_crowd_close(handle);
            // Another thread reads: the handle is still open.
            if (closed == TroupeStatus.Busy) TroupeException.Check(closed);
            handle = default(TroupeCrowd);
        }
    }
}
