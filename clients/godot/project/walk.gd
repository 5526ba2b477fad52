extends Node3D
## The arrow keys move a character. Enter sends it to the middle, Space has it wave.

const SPEED_MPS := 1.4

var _way := Vector3.ZERO

@onready var _server: TroupeServer = $Server
@onready var _character: TroupeCharacter = $Character


func _ready() -> void:
	_server.failed.connect(func(message: String) -> void: push_error(message))
	_character.opened.connect(func() -> void: print("the character is on the server"))
	_character.failed.connect(func(message: String) -> void: push_error(message))
	_character.refused.connect(func(message: String) -> void: push_warning(message))
	_character.arrived.connect(
		func(distance_m: float) -> void: print("arrived, %.2f m beside the place" % distance_m)
	)


func _process(_delta: float) -> void:
	var keys := Input.get_vector("ui_left", "ui_right", "ui_up", "ui_down")
	var way := Vector3(keys.x, 0, keys.y) * SPEED_MPS
	if way != _way:
		_way = way
		_character.walk(way)


func _unhandled_key_input(event: InputEvent) -> void:
	if not event.is_pressed() or event.is_echo():
		return
	match (event as InputEventKey).keycode:
		KEY_ENTER:
			_character.walk_to(Vector3.ZERO)
		KEY_SPACE:
			_character.perform("a person waves")
