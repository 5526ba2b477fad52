using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Net;
using System.Text;
using System.Text.RegularExpressions;
using Troupe;
using Troupe.Native;

/// <summary>Tests of the C# layer, for Mono: mono Program.exe POSES.JSON, with TROUPE_SERVER set.</summary>
internal static class Program
{
    private static int Main(string[] arguments)
    {
        var url = Environment.GetEnvironmentVariable("TROUPE_SERVER");
        AxesAreThoseOfTheTable(File.ReadAllText(arguments[0]));
        Check(Fails(() => new Connection("ftp://a"), TroupeStatus.Address).Field == "options.url", "the field");
        Fails(() => new Connection("http://127.0.0.1:1"), TroupeStatus.Unreachable);
        using (var connection = new Connection(url))
        {
            Check(connection.Packs().Length > 0, "packs");
            var refused = Fails(() => connection.OpenPack("no-such-pack"), TroupeStatus.Refused);
            Check(refused.Message.Contains("no-such-pack"), refused.Message);
            using (var pack = connection.OpenPack())
            {
                PackIsDescribed(pack);
                StepsAreRepeatable(pack);
                NotesCome(pack);
                TheServersClockGoesOn(pack);
                pack.Dispose(); // twice is once
            }
            ARigOfUnityIsWorn(url, connection);
        }
        Console.WriteLine("the C# layer passes its tests");
        return 0;
    }

    private static void AxesAreThoseOfTheTable(string json)
    {
        var rows = 0;
        foreach (var line in json.Split('\n'))
        {
            if (!line.StartsWith("{")) continue;
            float[] position = Numbers(line, "troupe", "position"), rotation = Numbers(line, "troupe", "rotation");
            float[] there = Numbers(line, "unity", "position"), turned = Numbers(line, "unity", "rotation");
            var p = Axes.Flip(new Vec3(position[0], position[1], position[2]));
            Near(p, new Vec3(there[0], there[1], there[2]), 1e-5f, line);
            var q = Axes.Flip(new Quat(rotation[0], rotation[1], rotation[2], rotation[3]));
            Check(Math.Abs(q.X - turned[0]) + Math.Abs(q.Y - turned[1]) + Math.Abs(q.Z - turned[2])
                + Math.Abs(q.W - turned[3]) < 1e-5, line);
            Near(Axes.Flip(p), new Vec3(position[0], position[1], position[2]), 1e-5f, "back: " + line);
            rows++;
        }
        Check(rows >= 8, "rows of the table");
    }

    private static void PackIsDescribed(Pack pack)
    {
        Check(pack.Joints.Length > 1 && pack.Parents[0] == -1 && pack.Parents.Length == pack.Joints.Length, "joints");
        Check(Array.IndexOf(pack.Styles, pack.DefaultStyle) >= 0, "the default style");
        Check(pack.Contacts.Length > 0 && pack.Version != "" && pack.Licence != "", "the pack's texts");
        var wrong = new Character { Style = "no-such-style" };
        var refused = Fails(() => pack.OpenCrowd(null, wrong), TroupeStatus.Refused);
        Check(refused.Field == "sessions[0].style" && refused.Reason == "UNKNOWN_STYLE", refused.Field);
    }

    private static void StepsAreRepeatable(Pack pack)
    {
        var options = new CrowdOptions { Clock = TroupeClock.Caller, JointPositions = true };
        var guard = new Character { Seed = 7, Position = new Vec3(2, 0, 1) };
        using (var one = pack.OpenCrowd(options, guard))
        using (var other = pack.OpenCrowd(options, guard))
        {
            var walk = new Locomotion { Velocity = new Vec3(0, 0, 1.4f), Facing = 0.5f };
            one.Move(0, walk);
            other.Move(0, walk);
            Frames a = one.Step(60), b = other.Step(60);
            Check(a.IsPresent(0) && a.FrameCount == 60 && a.JointCount == pack.Joints.Length, "the shape of frames");
            for (var frame = 0; frame < 60; frame++)
            {
                Near(a.Root(0, frame), b.Root(0, frame), 0, "the same seed gives the same frames");
                Near(a.Root(0, frame), a.JointPosition(0, 0, frame), 0, "the first joint is the root");
            }
            Check(a.Root(0, 59).Z > 2 && Math.Abs(a.Root(0, 59).X - 2) < 0.5, "it walks ahead: " + a.Root(0, 59));
            Throws<ArgumentOutOfRangeException>(() => a.Root(1));
            Throws<ArgumentOutOfRangeException>(() => a.Rotation(0, a.JointCount));
            one.Step();
            Throws<InvalidOperationException>(() => a.Root(0));
            one.Dispose();
            Fails(() => one.Step(), TroupeStatus.Handle);
        }
    }

    private static void NotesCome(Pack pack)
    {
        using (var crowd = pack.OpenCrowd(new CrowdOptions { Clock = TroupeClock.Caller }, new Character { Seed = 1 }))
        {
            Check(Fails(() => crowd.Stand(1), TroupeStatus.Argument).Allowed == "0 to 0", "what is allowed");
            crowd.Move(0, new Locomotion { Velocity = new Vec3(0, 0, 1), Style = "no-such-\u00e9t\u00e9" });
            var refused = Until(crowd, TroupeNoteKind.Refused);
            Check(refused.Character == 0 && refused.Message.Contains("no-such-\u00e9t\u00e9"), refused.Message);
            crowd.FollowPath(0, new[] { new PathPoint(), new PathPoint { Position = new Vec3(0, 0, 1.5f) } });
            Check(Until(crowd, TroupeNoteKind.Arrived).Values[1] < 0.5, "it arrives");
            crowd.GoTo(0, new Vec3(1, 0, 1.5f));
            Until(crowd, TroupeNoteKind.Arrived);
        }
    }

    private static void TheServersClockGoesOn(Pack pack)
    {
        var characters = new[] { new Character { Seed = 1 }, new Character { Seed = 2, Position = new Vec3(3, 0, 0) } };
        using (var crowd = pack.OpenCrowd(new CrowdOptions { RateHz = 60 }, characters))
        {
            Fails(() => crowd.Step(), TroupeStatus.Argument);
            crowd.Move(1, new Locomotion { Velocity = new Vec3(0, 0, 1.4f) });
            var last = -1L;
            var place = default(Vec3);
            // A busy server is slow, and characters with it.
            for (int ticks = 0, tries = 0; ticks < 60 || place.Z < 0.8; tries++)
            {
                Check(tries < 3000, "ticks come, and it walks: " + place);
                Frames frames;
                if (!crowd.TryRead(out frames, 1000) || !frames.IsPresent(1)) continue;
                Check(frames.Tick > last, "ticks count up");
                last = frames.Tick;
                place = frames.Root(1);
                ticks++;
            }
        }
    }

    /// <summary>A person of 1.7 m in Unity's world, with joints whose axes point anywhere.</summary>
    private static void ARigOfUnityIsWorn(string url, Connection connection)
    {
        var names = new List<string>();
        var parents = new List<int>();
        var places = new List<Vec3>();
        Action<string, string, float, float, float> add = (name, parent, x, y, z) =>
        {
            names.Add(name);
            parents.Add(parent == null ? -1 : names.IndexOf(parent));
            places.Add(new Vec3(x, y, z));
        };
        add("Hips", null, 0, 0.95f, 0);
        add("Spine", "Hips", 0, 1.1f, 0);
        add("Chest", "Spine", 0, 1.25f, 0);
        add("Neck", "Chest", 0, 1.45f, 0);
        add("Head", "Neck", 0, 1.55f, 0.02f);
        foreach (var side in new[] { "Left", "Right" })
        {
            var x = side == "Left" ? -1f : 1f; // Unity's X is to the right
            add(side + "Shoulder", "Chest", x * 0.05f, 1.42f, 0);
            add(side + "UpperArm", side + "Shoulder", x * 0.18f, 1.42f, 0);
            add(side + "LowerArm", side + "UpperArm", x * 0.45f, 1.42f, 0);
            add(side + "Hand", side + "LowerArm", x * 0.7f, 1.42f, 0);
            add(side + "UpperLeg", "Hips", x * 0.1f, 0.9f, 0);
            add(side + "LowerLeg", side + "UpperLeg", x * 0.1f, 0.5f, 0.01f);
            add(side + "Foot", side + "LowerLeg", x * 0.1f, 0.09f, 0);
            add(side + "Toes", side + "Foot", x * 0.1f, 0.02f, 0.14f);
        }
        var turns = new Quat[names.Count];
        for (var i = 0; i < turns.Length; i++) turns[i] = Turn(i + 1, 2 * i - 3, 5 - i, 0.4f * i);
        var rig = new Rig(names.ToArray(), parents.ToArray(), places.ToArray(), turns);
        Put(url + "/v1/skeletons/csharp-test", rig.ToJson());

        using (var pack = connection.OpenPack(skeleton: "csharp-test"))
        using (var crowd = pack.OpenCrowd(new CrowdOptions { Clock = TroupeClock.Caller }, new Character { Seed = 3 }))
        {
            Check(string.Join(" ", pack.Joints) == string.Join(" ", names), "the rig's own joints");
            var frames = crowd.Step(30);
            var world = new Vec3[names.Count];
            var rotations = new Quat[names.Count];
            for (var i = 0; i < names.Count; i++)
            {
                // As Unity places children: local positions as they were, rotations of the frame.
                var local = Axes.Flip(frames.Rotation(0, i, 29));
                var parent = parents[i];
                rotations[i] = parent < 0 ? local : Times(rotations[parent], local);
                world[i] = parent < 0
                    ? Axes.Flip(frames.Root(0, 29))
                    : Plus(world[parent], Rotated(rotations[parent], Rotated(Inverse(turns[parent]), Minus(places[i], places[parent]))));
            }
            Func<string, Vec3> at = name => world[names.IndexOf(name)];
            Check(at("Head").Y > 1.4 && at("Head").Y < 1.7, "the head is up: " + at("Head"));
            foreach (var side in new[] { "Left", "Right" })
            {
                Check(Math.Abs(at(side + "Foot").Y - 0.09f) < 0.06, side + " foot on the ground: " + at(side + "Foot"));
                Check(at(side + "Hand").Y < at(side + "UpperArm").Y - 0.3, side + " arm hangs: " + at(side + "Hand"));
            }
            Check(at("LeftFoot").X < at("RightFoot").X, "left is left");
            Check(at("LeftToes").Z > at("LeftFoot").Z + 0.05, "toes point ahead");
        }
    }

    private static void Put(string url, string json)
    {
        var request = (HttpWebRequest)WebRequest.Create(url);
        request.Method = "PUT";
        request.ContentType = "application/json";
        var bytes = Encoding.UTF8.GetBytes(json);
        using (var body = request.GetRequestStream()) body.Write(bytes, 0, bytes.Length);
        try
        {
            request.GetResponse().Close();
        }
        catch (WebException refused)
        {
            using (var reader = new StreamReader(refused.Response.GetResponseStream())) Check(false, reader.ReadToEnd());
        }
    }

    private static Note Until(Crowd crowd, TroupeNoteKind kind)
    {
        for (var steps = 0; steps < 40; steps++)
        {
            crowd.Step(10);
            Note note;
            while (crowd.TryNote(out note)) if (note.Kind == kind) return note;
        }
        throw new Exception("no note of kind " + kind);
    }

    private static Quat Turn(float x, float y, float z, float angle)
    {
        var length = Math.Sqrt(x * x + y * y + z * z);
        var sin = Math.Sin(angle / 2) / length;
        return new Quat((float)(x * sin), (float)(y * sin), (float)(z * sin), (float)Math.Cos(angle / 2));
    }

    private static Quat Times(Quat a, Quat b) => new Quat(
        a.W * b.X + a.X * b.W + a.Y * b.Z - a.Z * b.Y,
        a.W * b.Y - a.X * b.Z + a.Y * b.W + a.Z * b.X,
        a.W * b.Z + a.X * b.Y - a.Y * b.X + a.Z * b.W,
        a.W * b.W - a.X * b.X - a.Y * b.Y - a.Z * b.Z);

    private static Quat Inverse(Quat of) => new Quat(-of.X, -of.Y, -of.Z, of.W);

    private static Vec3 Rotated(Quat q, Vec3 v)
    {
        var turned = Times(Times(q, new Quat(v.X, v.Y, v.Z, 0)), Inverse(q));
        return new Vec3(turned.X, turned.Y, turned.Z);
    }

    private static Vec3 Plus(Vec3 a, Vec3 b) => new Vec3(a.X + b.X, a.Y + b.Y, a.Z + b.Z);

    private static Vec3 Minus(Vec3 a, Vec3 b) => new Vec3(a.X - b.X, a.Y - b.Y, a.Z - b.Z);

    private static float[] Numbers(string line, string frame, string what)
    {
        var found = Regex.Match(line, "\"" + frame + "\": {[^}]*\"" + what + "\": \\[([^]]*)\\]").Groups[1].Value;
        return Array.ConvertAll(found.Split(','), number => float.Parse(number, CultureInfo.InvariantCulture));
    }

    private static void Near(Vec3 a, Vec3 b, float most, string what)
    {
        Check(Math.Abs(a.X - b.X) + Math.Abs(a.Y - b.Y) + Math.Abs(a.Z - b.Z) <= most, what + ": " + a + " " + b);
    }

    private static TroupeException Fails(Action call, TroupeStatus status)
    {
        try
        {
            call();
        }
        catch (TroupeException error)
        {
            Check(error.Status == status, "expected " + status + ", got " + error.Status + ": " + error.Message);
            return error;
        }
        throw new Exception("expected " + status + ", but it worked");
    }

    private static void Throws<T>(Action call) where T : Exception
    {
        try
        {
            call();
        }
        catch (T)
        {
            return;
        }
        throw new Exception("expected " + typeof(T).Name);
    }

    private static void Check(bool holds, string what)
    {
        if (!holds) throw new Exception(what);
    }
}
