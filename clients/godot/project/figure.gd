class_name Figure
extends Skeleton3D
## A person of sticks on the bones of Godot's humanoid profile. It needs no file of a model.

const THICKNESS_M := 0.05


func _init() -> void:
	var profile := SkeletonProfileHumanoid.new()
	for index in profile.bone_size:
		add_bone(profile.get_bone_name(index))
	for index in profile.bone_size:
		set_bone_parent(index, find_bone(profile.get_bone_parent(index)))
		set_bone_rest(index, profile.get_reference_pose(index))
	reset_bone_poses()


func _ready() -> void:
	for index in get_bone_count():
		var parent := get_bone_parent(index)
		if parent > 0:
			_add_stick(parent, get_bone_rest(index).origin)


## A stick from a bone to a place in its frame.
func _add_stick(bone: int, to: Vector3) -> void:
	if to.is_zero_approx():
		return
	var shape := CapsuleMesh.new()
	shape.radius = minf(THICKNESS_M, to.length() / 2)
	shape.height = maxf(to.length(), 2 * shape.radius)
	var stick := MeshInstance3D.new()
	stick.mesh = shape
	stick.position = to / 2
	stick.quaternion = Quaternion(Vector3.UP, to.normalized())
	var holder := BoneAttachment3D.new()
	add_child(holder)
	holder.bone_idx = bone
	holder.add_child(stick)
