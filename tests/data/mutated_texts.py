"""Files that tests break at random places: a problem of all sorts, a recorded one, and two small robots."""

PROBLEM = """
title = "all sorts"
[simulation]
duration = 0.2
dt = 0.01
[world]
gravity = [0, 0, -9.81]
[ground]
friction = 0.4
restitution = 0.2
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
velocity = [1, 0, 0]
collides_with = ["ground"]
[[body]]
name = "rod"
shape = { capsule = { radius = 0.05, length = 0.4 } }
density = 500
position = [0, 2, 1]
collides_with = []
orientation = { roll_deg = 30 }
[[body]]
name = "brick"
shape = { parts = [ { box = { size = [0.1, 0.2, 0.3] }, centre = [0, 0, 0.05] }, { sphere = { radius = 0.1 } } ] }
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [3, 2, 1]
collides_with = []
[[joint]]
name = "pin"
between = ["world", "rod"]
hinge = { axis = [0, 1, 0] }
point = [0, 2, 1.2]
limits = [-1, 2]
spring = { stiffness = 3, damping = 0.2, rest = 0.1 }
start = 0.3
motor = { torque = { torque = 8.0 } }
[[terrain]]
name = "dunes"
heights = [[0, 1], [2, 3], [1, 1]]
spacing = [1, 2]
origin = [5, 5]
[[reference]]
name = "r"
table = { time = [0, 0.1, 0.2], x = [0, 0.5, 1] }
interpolation = "cubic"
[[force]]
name = "wind"
on = "ball.force"
value = "wind.c * [1, 0, 0] - 0.1 * ball.velocity"
numbers = { c = 0.3 }
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0, 2]
lower = -10
upper = 10
[[variable]]
name = "push"
sets = "pin.command"
knots = 5
interpolation = "linear"
[[cost]]
name = "effort"
at = "always"
squares = "0.1 * push"
[[target]]
name = "there"
value = "ball.position[0] - r.x"
tolerance = 0.01
[[constraint]]
name = "above"
at = "always"
value = "ball.position[2]"
lower = -1
"""
RECORDED = """
[simulation]
duration = 0.4
dt = 0.1
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
collides_with = []
[[variable]]
name = "v"
sets = "ball.velocity"
[[recording]]
name = "drop"
files = "FILE"
measured = [{ value = "ball.position[2]", columns = "z", noise = 0.01 }]
"""
MODELS = {
    "robot.xml": b"""<mujoco model="m"><compiler angle="radian"/><default><geom density="900"/></default>
<asset><mesh name="t" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<body name="a" pos="0 0 1"><freejoint/><geom name="g" type="mesh" mesh="t"/><site name="s"/>
<body name="b" pos="0.2 0 0"><joint name="j" axis="0 1 0" range="-1 1" limited="true" armature="0.1"/>
<geom type="capsule" size="0.05 0.2"/></body></body></worldbody><actuator><position joint="j" kp="4"/></actuator>
<sensor><jointpos joint="j"/></sensor><keyframe><key name="k" qpos="0 0 2 1 0 0 0 0.5"/></keyframe></mujoco>""",
    "robot.urdf": b"""<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="b"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><origin xyz="1 0 0" rpy="0 0 1"/><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="3" velocity="2"/></joint></robot>""",
}
