"""Setup of the tests of messages: where their classes are."""

from ros_messages import add_message_packages

add_message_packages()
