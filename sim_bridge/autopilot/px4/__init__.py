"""PX4's behaviour (https://docs.px4.io), as it shows on MAVLink: measured on PX4 1.15 in software-in-the-loop."""
