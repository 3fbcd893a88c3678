#!/usr/bin/env bash
# Fast DDS (rmw_fastrtps_cpp 8.4.3, rclpy 7.1.6, ROS 2 Jazzy): the bytes of one and the same message, as a raw subscription
# gets them, depend on where the publisher runs. Within one process they end with the message's last field; from another
# process they are filled up with zeros to whole words of four bytes. A checksum of raw messages must therefore be taken of
# whole words. Source: seen with the packages named below; RTPS pads the payload of a submessage to four bytes.
# Seen: own process 65, 66, 67, 68 bytes; another process 68, 68, 68, 68 bytes. Fails if that changes.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check 'ros-jazzy-rclpy[fastrtps]==7.1.6' 'ros-jazzy-common-interfaces==5.3.6' \
    'ros-rmw-fastrtps-cpp==8.4.3' 'numpy<2.3' pyyaml
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=77
cat > "$folder/talk.py" <<'PYTHON'
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from std_msgs.msg import String

rclpy.init()
latched = QoSProfile(depth=10, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
node = rclpy.create_node(sys.argv[1])
if sys.argv[1] in ("both", "talker"):
    publisher = node.create_publisher(String, "texts", latched)
    for count in range(56, 60):
        publisher.publish(String(data="x" * count))
heard = []
if sys.argv[1] in ("both", "listener"):
    node.create_subscription(String, "texts", lambda data: heard.append(len(data)), latched, raw=True)
executor = SingleThreadedExecutor()
executor.add_node(node)
end = time.monotonic() + 20.0
while time.monotonic() < end and len(heard) < 4:
    executor.spin_once(timeout_sec=0.1)
print(*sorted(heard))
PYTHON
own=$("$folder/venv/bin/python" "$folder/talk.py" both)
"$folder/venv/bin/python" "$folder/talk.py" talker >/dev/null &
other=$("$folder/venv/bin/python" "$folder/talk.py" listener)
wait
echo "own process: $own; another process: $other"
[ "$own" = "65 66 67 68" ] && [ "$other" = "68 68 68 68" ]
