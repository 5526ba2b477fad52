extends SceneTree
## Runs the extension in Godot against the servers that engine.sh starts.

## A busy machine is slow.
const LIMIT_S := 180.0
## Longest frame while a character opens. A call that waits for the network takes longer.
const LONGEST_FRAME_MS := 250.0

var _checks := 0


func _initialize() -> void:
	Engine.max_fps = 60
	_run()


func _run() -> void:
	var url := OS.get_environment("TROUPE_SERVER")
	await _an_address_without_a_server_fails()
	await _wrong_properties_fail()
	var server := await _opened(url, "")
	await _a_character_stands_and_walks(server)
	await _a_skeleton_in_centimetres_stands_where_its_node_is(server)
	await _commands_are_refused_and_limited(server)
	await _sentences_are_acted_out(server)
	await _the_example_runs()
	await _the_script_of_the_tutorial_runs()
	await _a_connection_that_is_opened_again_has_its_characters(server)
	await _a_connection_that_breaks_goes_on()
	await _tls_and_a_key_are_needed()
	print("Godot %s: %d checks passed" % [Engine.get_version_info()["string"], _checks])
	# One character is left, which is closed at the exit.
	quit(0)


func _an_address_without_a_server_fails() -> void:
	var server := TroupeServer.new()
	server.url = "http://127.0.0.1:1"
	var failures := _noted(server.failed)
	var character := _figure(Vector3.ZERO)
	character.server = server
	var of_character := _noted(character.failed)
	root.add_child(server)
	root.add_child(character)
	await _until(func() -> bool: return failures.size() + of_character.size() >= 2, "failures come")
	_check(str(failures[0]).contains("refused"), failures[0])
	_check(failures == of_character, "the character hears of it: %s" % [of_character])
	_check(not server.is_open(), "it is not open")
	_free(character)
	_free(server)


func _wrong_properties_fail() -> void:
	var server := TroupeServer.new()
	server.open_at_start = false
	server.key_file = "user://key.pem"
	var failures := _noted(server.failed)
	root.add_child(server)
	server.open()
	_check(failures == ["key_file is set, so certificate_file must be set too"], failures)
	server.rate_hz = 25
	server.open()
	_check(failures[1] == "rate_hz is 25, but must be 30, 50 or 60", failures)
	_free(server)


func _opened(url: String, key: String, ca_file := "") -> TroupeServer:
	var server := TroupeServer.new()
	server.url = url
	server.key = key
	server.ca_file = ca_file
	var opened := _noted(server.opened)
	var failed := _noted(server.failed)
	root.add_child(server)
	await _until(func() -> bool: return not (opened + failed).is_empty(), "the server opens")
	_check(server.is_open(), failed)
	return server


func _a_character_stands_and_walks(server: TroupeServer) -> void:
	var character := _figure(Vector3(2, 0, -1))
	character.server = server
	var failed := _noted(character.failed)
	var arrived := _noted(character.arrived)
	root.add_child(character)
	var longest_ms := 0.0
	var begin := Time.get_ticks_usec()
	while not character.is_moving() and failed.is_empty():
		await process_frame
		var now := Time.get_ticks_usec()
		longest_ms = maxf(longest_ms, (now - begin) / 1000.0)
		begin = now
	_check(failed.is_empty(), failed)
	_check(
		longest_ms < LONGEST_FRAME_MS,
		"a frame took %.0f ms while the character opened" % longest_ms
	)

	await _seconds(0.5)
	# It looks along +Z at first, as its model does: its left is at +X.
	_stands(character, Vector3(2, 0, -1), Vector3.BACK)

	character.walk(Vector3(0, 0, -1.3))
	await _until(func() -> bool: return character.global_position.z < -3, "it walks along -Z")
	_check(absf(character.global_position.x - 2) < 0.7, character.global_position)
	_check(character.global_position.y == 0, "the node stays on its ground")
	_looks(character, Vector3.FORWARD)

	# Sideways: it goes along +X, and looks along -Z.
	character.walk(Vector3(0.8, 0, 0), Vector3.FORWARD)
	var from := character.global_position.x
	await _until(func() -> bool: return character.global_position.x > from + 1, "it walks along +X")
	_looks(character, Vector3.FORWARD)

	character.walk_to(Vector3(1, 0, 0))
	await _until(func() -> bool: return not arrived.is_empty(), "it arrives")
	_check(arrived[0] < 0.5, arrived)
	var off := character.hips_position() - Vector3(1, 0, 0)
	_check(
		Vector2(off.x, off.z).length() < 0.6, "it is at the place: %s" % character.hips_position()
	)

	# A node that does not follow stays, and the hips go.
	character.follow = false
	var place := character.global_position
	character.follow_path(PackedVector3Array([place, place + Vector3(0, 0, 2)]), 1.2)
	await _until(func() -> bool: return arrived.size() >= 2, "it comes to the end of the path")
	_check(character.global_position == place, "the node stays")
	_check(character.hips_position().z > place.z + 1.4, character.hips_position())
	_check(
		_world(character, "Hips").distance_to(character.hips_position()) < 0.01,
		"the hips are where they are"
	)
	_free(character)


## The bones are in centimetres with Z up, under an armature that makes metres of them. The model
## looks along -Z of a node that is turned, on a floor in the third storey.
func _a_skeleton_in_centimetres_stands_where_its_node_is(server: TroupeServer) -> void:
	var character := TroupeCharacter.new()
	character.server = server
	character.model_front = 1
	var armature := Node3D.new()
	armature.transform = Transform3D(
		Basis(Vector3.RIGHT, -PI / 2).scaled(0.01 * Vector3.ONE), Vector3.ZERO
	)
	character.add_child(armature)
	var skeleton := Figure.new()
	var up := Transform3D(Basis(Vector3.RIGHT, PI / 2) * Basis(Vector3.UP, PI), Vector3.ZERO)
	for bone in skeleton.get_bone_count():
		var rest := skeleton.get_bone_rest(bone)
		rest.origin *= 100
		if skeleton.get_bone_parent(bone) < 0:
			rest = up * rest
		skeleton.set_bone_rest(bone, rest)
	skeleton.reset_bone_poses()
	armature.add_child(skeleton)
	character.transform = Transform3D(Basis(Vector3.UP, deg_to_rad(60)), Vector3(-4, 6, 3))
	var failed := _noted(character.failed)
	root.add_child(character)
	# Commands wait until the character is there.
	character.walk(Vector3.ZERO)
	await _until(func() -> bool: return character.is_moving() or not failed.is_empty(), "it moves")
	_check(failed.is_empty(), failed)
	await _seconds(0.5)
	_stands(character, Vector3(-4, 6, 3), character.global_basis * Vector3.FORWARD)
	_free(character)


func _commands_are_refused_and_limited(server: TroupeServer) -> void:
	var nameless := _figure(Vector3.ZERO)
	nameless.server = server
	nameless.root_bone = "Pelvis"
	var unknown_bone := _noted(nameless.failed)
	root.add_child(nameless)
	await _until(func() -> bool: return not unknown_bone.is_empty(), "the bone is unknown")
	_check(str(unknown_bone[0]).contains("no bone is named `Pelvis`"), unknown_bone)
	_free(nameless)

	# Without a name it finds the server of the scene.
	var character := _figure(Vector3.ZERO)
	var refused := _noted(character.refused)
	var opened := _noted(character.opened)
	root.add_child(character)
	for nth in 17:
		character.drop_object()
	_check(refused == ["16 commands of the character wait already, which is the most"], refused)
	await _until(func() -> bool: return not opened.is_empty(), "it opens")
	refused.clear()
	character.style = "no-such-style"
	character.walk(Vector3(0, 0, 1))
	await _until(func() -> bool: return _has(refused, "no-such-style"), "the style is refused")
	character.priority = 0.9
	character.cancel()
	await _seconds(0.3)
	_check(character.is_moving(), "it goes on")
	_free(character)


func _sentences_are_acted_out(server: TroupeServer) -> void:
	var character := _figure(Vector3.ZERO)
	character.server = server
	var performing := _noted(character.performing)
	var performed := _noted(character.performed)
	var refused := _noted(character.refused)
	root.add_child(character)
	character.perform("a person waves with the left hand", 2.0)
	await _until(
		func() -> bool: return not performed.is_empty() or not refused.is_empty(),
		"it acts out the sentence"
	)
	_check(refused.is_empty(), refused)
	_check(performing == ["a person waves with the left hand"], performing)
	_check(performed == ["DONE"], performed)
	_free(character)


## The scene of the example, with its own server, and a key.
func _the_example_runs() -> void:
	var example: Node3D = load("res://walk.tscn").instantiate()
	example.get_node("Server").url = OS.get_environment("TROUPE_SERVER")
	var character: TroupeCharacter = example.get_node("Character")
	var failed := _noted(character.failed)
	root.add_child(example)
	await _until(
		func() -> bool: return character.is_moving() or not failed.is_empty(), "the example moves"
	)
	_check(failed.is_empty(), failed)
	Input.action_press("ui_up")
	await _until(
		func() -> bool: return character.global_position.z < -0.5, "a key moves it along -Z"
	)
	Input.action_release("ui_up")
	_free(example)


## The nodes of the tutorial, with its script.
func _the_script_of_the_tutorial_runs() -> void:
	var scene := Node3D.new()
	var character := _figure(Vector3.ZERO)
	character.name = "TroupeCharacter"
	scene.add_child(character)
	scene.set_script(load("res://tutorial.gd"))
	var arrived := _noted(character.arrived)
	var performing := _noted(character.performing)
	root.add_child(scene)
	var ends := _noted(character.failed)
	character.refused.connect(ends.append)
	await _until(func() -> bool: return not (arrived + ends).is_empty(), "it arrives")
	_check(ends.is_empty() and arrived[0] < 0.5, [arrived, ends])
	await _until(func() -> bool: return not (performing + ends).is_empty(), "it waves")
	_check(performing == ["a person waves"], performing)
	# Another model takes the place of the first.
	character.get_child(0).free()
	await _until(func() -> bool: return not character.is_moving(), "without a model it leaves")
	character.add_child(Figure.new())
	root.remove_child(scene)
	root.add_child(scene)
	await _until(character.is_moving, "it moves the new model")
	_free(scene)


func _a_connection_that_is_opened_again_has_its_characters(server: TroupeServer) -> void:
	var character := _figure(Vector3(5, 0, 5))
	character.server = server
	var opened := _noted(character.opened)
	root.add_child(character)
	await _until(func() -> bool: return opened.size() == 1, "it opens")
	server.open()
	await _until(func() -> bool: return opened.size() == 2, "it opens once more")
	await _until(character.is_moving, "it moves")
	# Out of the scene it leaves the server, and it comes back with its node.
	root.remove_child(character)
	await _seconds(0.2)
	_check(not character.is_moving(), "it left")
	root.add_child(character)
	await _until(func() -> bool: return opened.size() == 3, "it opens a third time")


func _a_connection_that_breaks_goes_on() -> void:
	var server := await _opened(OS.get_environment("TROUPE_FORWARDER"), "")
	var character := _figure(Vector3.ZERO)
	character.server = server
	var opened := _noted(character.opened)
	var failed := _noted(character.failed)
	var kinds := []
	character.happened.connect(
		func(kind: String, _subject: String, _detail: String) -> void: kinds.append(kind)
	)
	root.add_child(character)
	character.walk(Vector3(1, 0, 0))
	await _until(func() -> bool: return character.global_position.x > 0.5, "it walks")
	OS.execute("kill", ["-USR1", OS.get_environment("TROUPE_FORWARDER_PID")])
	await _until(
		func() -> bool: return kinds.has("resumed") or not failed.is_empty(), "it comes back"
	)
	_check(failed.is_empty(), failed)
	var from := character.global_position.x
	await _until(func() -> bool: return character.global_position.x > from + 0.5, "it walks on")
	_check(opened.size() == 1, "it is opened once")
	_free(character)
	_free(server)


func _tls_and_a_key_are_needed() -> void:
	var url := OS.get_environment("TROUPE_TLS_SERVER")
	var authority := OS.get_environment("TROUPE_TLS_CA")
	# The first key may send a skeleton. The second may not, and uses that one.
	for key: String in ["TROUPE_TLS_AUTHOR_KEY", "TROUPE_TLS_DRIVE_KEY"]:
		var server := await _opened(url, OS.get_environment(key), authority)
		var character := _figure(Vector3.ZERO)
		character.server = server
		var failed := _noted(character.failed)
		root.add_child(character)
		await _until(
			func() -> bool: return character.is_moving() or not failed.is_empty(),
			"it moves over TLS"
		)
		_check(failed.is_empty(), failed)
		_free(character)
		_free(server)

	for wrong: Array in [
		["troupe_wrong", authority], [OS.get_environment("TROUPE_TLS_AUTHOR_KEY"), ""]
	]:
		var server := TroupeServer.new()
		server.url = url
		server.key = wrong[0]
		server.ca_file = wrong[1]
		var refused := _noted(server.failed)
		root.add_child(server)
		await _until(
			func() -> bool: return not refused.is_empty(), "a wrong key or authority is refused"
		)
		_check(_has(refused, "key" if wrong[1] else "certificate"), refused)
		_free(server)


## A character with a figure of 56 bones.
func _figure(place: Vector3) -> TroupeCharacter:
	var character := TroupeCharacter.new()
	character.seed = 7
	character.position = place
	character.add_child(Figure.new())
	return character


## A bone in the world of the scene.
func _world(character: TroupeCharacter, bone: String) -> Vector3:
	var skeleton: Skeleton3D = character.find_children("*", "Skeleton3D", true, false)[0]
	return (
		skeleton.global_transform * skeleton.get_bone_global_pose(skeleton.find_bone(bone)).origin
	)


## The profile's ankles are on the ground, and its head is 1.25 m above it.
func _stands(character: TroupeCharacter, place: Vector3, ahead: Vector3) -> void:
	var hips := _world(character, "Hips") - place
	_check(Vector2(hips.x, hips.z).length() < 0.3, "it is at its place: %s" % hips)
	var head := _world(character, "Head").y - place.y
	_check(absf(head - 1.25) < 0.1, "the head is up: %.2f m" % head)
	for side: String in ["Left", "Right"]:
		var foot := _world(character, side + "Foot").y - place.y
		_check(absf(foot) < 0.06, "the %s foot is on the ground: %.2f m" % [side, foot])
		var arm := _world(character, side + "UpperArm").y - _world(character, side + "Hand").y
		_check(arm > 0.3, "the %s arm hangs: %.2f m" % [side, arm])
	_looks(character, ahead)


func _looks(character: TroupeCharacter, ahead: Vector3) -> void:
	var left := Vector3.UP.cross(ahead)
	var across := _world(character, "LeftUpperLeg") - _world(character, "RightUpperLeg")
	_check(across.normalized().dot(left) > 0.8, "left is left: %s" % across)
	for side: String in ["Left", "Right"]:
		var toes := _world(character, side + "Toes") - _world(character, side + "Foot")
		_check(toes.normalized().dot(ahead) > 0.2, "the %s toes point ahead: %s" % [side, toes])


## What a signal brings, from now on.
func _noted(of: Signal) -> Array:
	var all := []
	var arguments: int = 0
	for known: Dictionary in of.get_object().get_signal_list():
		if known["name"] == of.get_name():
			arguments = known["args"].size()
	match arguments:
		0:
			of.connect(func() -> void: all.append(true))
		1:
			of.connect(func(first: Variant) -> void: all.append(first))
	return all


func _has(all: Array, part: String) -> bool:
	return all.any(func(one: Variant) -> bool: return str(one).contains(part))


func _until(holds: Callable, what: String) -> void:
	var end := Time.get_ticks_msec() + int(LIMIT_S * 1000)
	while not holds.call():
		if Time.get_ticks_msec() > end:
			_check(false, "not after %d s: %s" % [LIMIT_S, what])
			return
		await process_frame
	_checks += 1


func _seconds(seconds: float) -> void:
	await create_timer(seconds).timeout


func _free(node: Node) -> void:
	root.remove_child(node)
	node.free()


func _check(holds: bool, what: Variant) -> void:
	_checks += 1
	if holds:
		return
	printerr("FAILED: ", what)
	for call: Dictionary in get_stack():
		printerr("  at %s:%d" % [call["function"], call["line"]])
	OS.kill(OS.get_process_id())
