"""Measures the free surface of a liquid in camera images.

What all rooms share stands here: errors, settings, measurement. The rooms import in one direction:

    optics      lens, pose and walls of a container: from a pixel to a height and back
    images      pictures by themselves: decoding, damage, repeats, edges at rest, words
    calibrate   camera.yaml, and finding its pose       → optics, images
    cylinder    the detector of cylinders               → optics, images
    rectangle   the detector of rectangular containers  → optics, images
    detection   the detector that fits, pictures        → cylinder, rectangle, optics, images
    nodes       the ROS node                            → calibrate, detection, images
"""
