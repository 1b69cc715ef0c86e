"""ArduPilot Copter's behaviour (https://ardupilot.org/copter), as it shows on MAVLink: measured on 4.7-dev in SITL."""
