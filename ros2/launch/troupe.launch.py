"""Starts troupe-ros2 for one robot, the publisher of its links, and RViz.

ros2 launch ros2/launch/troupe.launch.py urdf:=g1_29dof_rev_1_0.urdf
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    "urdf": ("", "The robot's URDF. Without it there are joints and the root link alone, and no RViz."),
    "name": ("g1", "Namespace of the robot"),
    "pack": ("g1", "Pack that moves it, or PACK/BODY"),
    "server": ("http://127.0.0.1:8080", "Address of the Troupe server"),
    "rate": ("50", "Poses a second: 30, 50 or 60"),
    "use_sim_time": ("false", "Whether stamps come from /clock"),
    "command": ("troupe-ros2", "The program"),
    "rviz": ("true", "Whether to start RViz"),
}


def model(file: Path) -> str:
    """The text of a URDF, whose meshes RViz finds wherever it was started."""
    folder = file.resolve().parent
    return file.read_text().replace('filename="meshes/', f'filename="file://{folder}/meshes/')


def processes(context: LaunchContext) -> list:
    """What to start."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    name, is_sim = given["name"], given["use_sim_time"].lower() == "true"
    command = [given["command"], "--server", given["server"], "--rate", given["rate"]]
    command += ["--robot", f"{name}:{given['pack']}", *(["--use-sim-time"] if is_sim else [])]
    # Signals to end it come from launch: SIGINT first.
    robot = ExecuteProcess(cmd=command, output="screen")
    if not given["urdf"]:
        return [robot]
    links = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=name,
        parameters=[
            {
                "robot_description": model(Path(given["urdf"])),
                "frame_prefix": f"{name}/",
                "publish_frequency": float(given["rate"]),
                "use_sim_time": is_sim,
            }
        ],
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["--fixed-frame", "odom"],
        parameters=[{"use_sim_time": is_sim}],
        condition=IfCondition(given["rviz"]),
    )
    return [robot, links, rviz]


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` asks for."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=processes)])
