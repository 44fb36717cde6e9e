"""A scenario's nodes under `ros2 launch`, each in its own process, from the same parameter file.

    ros2 launch haptic_teleop_control scenario.launch.py file:=config/scenario1_sim.yaml

The ROS wheels hold no `launch_ros`, so this file could not be run where the project is tested: it is only
checked to compile. The nodes that it starts are those of `haptic-teleop scenario FILE --processes`; where
the file says use_sim_time: true, the coordinator that grants them their time is one of them.
"""


def generate_launch_description():
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch.substitutions import LaunchConfiguration
    from launch_ros.actions import Node

    def nodes(context):
        from haptic_teleop_control.front_door import registries
        from haptic_teleop_control.nodes.scenario import load_scenario

        scenario = load_scenario(LaunchConfiguration("file").perform(context))
        packages = {name: package for package, entries in registries().items() for name in entries}
        file = str(scenario.file.resolve())
        parameters = {name: [file] for name in scenario.nodes}
        if scenario.simulated:
            parameters["time_coordinator"] = [
                file,
                {
                    "participants": list(scenario.nodes),
                    "real_time_factor": scenario.real_time_factor,
                    "duration": scenario.duration,
                },
            ]
        # Neither name nor namespace is given: they are the nodes' own defaults.
        return [
            Node(
                package=packages[name],
                executable=name,
                parameters=stated,
                output="screen",
                sigterm_timeout="5",
            )
            for name, stated in parameters.items()
        ]

    return LaunchDescription(
        [
            DeclareLaunchArgument("file", description="scenario file, such as config/scenario1_sim.yaml"),
            OpaqueFunction(function=nodes),
        ]
    )
