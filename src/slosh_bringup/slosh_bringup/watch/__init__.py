"""The operator's web page, which shows a cell's state.

state       what has been heard, as frames ten times a second → verdict
hearing     a message, live or recorded → state
picture     the camera's image and the liquid's line in it
access      who may look
hub         frames to viewers, none of whom can hold another up
server      the page over HTTP and one WebSocket → hub, access
recording   a bag as the same frames → state, hearing, picture
page/       what the browser gets; nothing comes from elsewhere
"""

HOST = "127.0.0.1"
PORT = 7567
"""Where the page is served unless told. Port 8765 is foxglove_bridge's."""
