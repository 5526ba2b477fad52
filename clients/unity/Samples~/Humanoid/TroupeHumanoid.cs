using System.Collections;
using System.Collections.Generic;
using System.Text;
using System.Threading.Tasks;
using Troupe;
using UnityEngine;
using UnityEngine.Networking;

/// <summary>
/// A humanoid character of the scene that a Troupe server moves. Its skeleton goes to the server as it stands at Start, so put
/// it into the scene in its T-pose; the server carries motion over to it. Arrow keys or W A S D move it.
/// </summary>
[RequireComponent(typeof(Animator))]
public sealed class TroupeHumanoid : MonoBehaviour
{
    [SerializeField] private string server = "http://127.0.0.1:8080";
    [SerializeField] private string skeletonName = "unity-humanoid";
    [SerializeField] private string style = "";
    [SerializeField] private float speed = 1.4f;

    private readonly List<Transform> joints = new List<Transform>();
    private Connection connection;
    private Pack pack;
    private Crowd crowd;
    private Task opening;

    private IEnumerator Start()
    {
        var animator = GetComponent<Animator>();
        Collect(animator);
        animator.enabled = false; // it would write the same joints

        var upload = UnityWebRequest.Put(
            server + "/v1/skeletons/" + skeletonName, Encoding.UTF8.GetBytes(TakeRig().ToJson()));
        upload.SetRequestHeader("content-type", "application/json");
        yield return upload.SendWebRequest();
        if (upload.result != UnityWebRequest.Result.Success)
        {
            Debug.LogError("The server does not take the skeleton: " + upload.downloadHandler.text, this);
            yield break;
        }

        var place = new Character
        {
            Seed = 1,
            Position = transform.position.ToTroupe(),
            Heading = transform.HeadingInTroupe(),
            Style = style,
        };
        opening = Task.Run(() => Open(place));
        while (!opening.IsCompleted) yield return null;
        if (opening.IsFaulted) Debug.LogException(opening.Exception.InnerException, this);
    }

    /// <summary>Connects. This waits for the server, so it is not done in a frame.</summary>
    private void Open(Character place)
    {
        connection = new Connection(server);
        pack = connection.OpenPack(skeleton: skeletonName);
        crowd = pack.OpenCrowd(new CrowdOptions { RateHz = 60 }, place);
    }

    private void Update()
    {
        if (crowd == null) return;
        var way = new Vector3(Input.GetAxis("Horizontal"), 0, Input.GetAxis("Vertical"));
        crowd.Move(0, new Locomotion { Velocity = (Vector3.ClampMagnitude(way, 1) * speed).ToTroupe() });
        while (crowd.TryNote(out var note)) Debug.Log(note.Kind + ": " + note.Message, this);

        Frames frames;
        if (!crowd.TryRead(out frames) || !frames.IsPresent(0)) return;
        joints[0].SetPositionAndRotation(frames.Root(0).ToUnity(), frames.Rotation(0, 0).ToUnity());
        for (var joint = 1; joint < joints.Count; joint++)
        {
            joints[joint].localRotation = frames.Rotation(0, joint).ToUnity();
        }
    }

    private void OnDestroy()
    {
        // Closing waits for the server, and for an opening that is under way.
        opening?.ContinueWith(done => Close());
    }

    private void Close()
    {
        crowd?.Dispose();
        pack?.Dispose();
        connection?.Dispose();
    }

    /// <summary>The bones of the humanoid and all joints between them, parents first.</summary>
    private void Collect(Animator animator)
    {
        var hips = animator.GetBoneTransform(HumanBodyBones.Hips);
        var wanted = new HashSet<Transform> { hips };
        for (var bone = HumanBodyBones.Hips; bone < HumanBodyBones.LastBone; bone++)
        {
            var joint = animator.GetBoneTransform(bone);
            while (joint != null && joint.IsChildOf(hips) && wanted.Add(joint)) joint = joint.parent;
        }
        foreach (var joint in hips.GetComponentsInChildren<Transform>())
        {
            if (wanted.Contains(joint)) joints.Add(joint); // parents come first
        }
    }

    /// <summary>The joints as they stand, as if the character stood at the origin and faced +Z.</summary>
    private Rig TakeRig()
    {
        var count = joints.Count;
        var names = new string[count];
        var parents = new int[count];
        var positions = new Vec3[count];
        var rotations = new Quat[count];
        var home = Quaternion.Inverse(transform.rotation);
        for (var i = 0; i < count; i++)
        {
            var position = home * (joints[i].position - transform.position);
            var rotation = home * joints[i].rotation;
            names[i] = joints[i].name;
            parents[i] = i == 0 ? -1 : joints.IndexOf(joints[i].parent);
            positions[i] = new Vec3(position.x, position.y, position.z);
            rotations[i] = new Quat(rotation.x, rotation.y, rotation.z, rotation.w);
        }
        return new Rig(names, parents, positions, rotations);
    }
}
