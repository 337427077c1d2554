"""Reasons why files of the drop zone belong to no recording."""

from __future__ import annotations


def still_written() -> str:
    """Return why a file is left to the next run."""
    return "still being written: the next run reads it"


def editor_backup(name: str) -> str:
    """Return why a file or folder with a name that ends in ~ is skipped."""
    return f"backup of an editor: the name {name!a} ends in ~"


def still_transferred(ending: str) -> str:
    """Return why a file with the ending of a transfer is skipped."""
    return f"still being transferred, by its ending {ending}"


def hidden(name: str) -> str:
    """Return why a file or folder with a name that begins with a dot is skipped."""
    return f"hidden: the name {name!a} begins with a dot"


def archive_attributes() -> str:
    """Return why the attributes in an archive are skipped."""
    return "copy of attributes that macOS adds to archives"


def documentation() -> str:
    """Return why a file of text is skipped."""
    return "documentation (.md)"


def settings_beside_sensors() -> str:
    """Return why settings beside the folders of the sensors are skipped."""
    return "settings beside the folders of the sensors, where they are not read"


def notes_without_log(log: str) -> str:
    """Return why notes are skipped beside which there is no log of their name."""
    return (
        f"notes without a log {log} beside them. Rename them, or add the log. A sensor file "
        "belongs in the folder of the sensor files"
    )


def misnamed_notes(name: str) -> str:
    """Return why notes with another ending are skipped, with the right name."""
    return f"notes that are not read: rename the file to {name}"


def linked_folder() -> str:
    """Return why a link to a folder is skipped."""
    return "link to a folder, which is not followed: link to its files, or copy it"


def closed_folder() -> str:
    """Return why a folder is skipped."""
    return "folder that cannot be listed"


def neither_file_nor_folder() -> str:
    """Return why a device or pipe is skipped."""
    return "neither a file nor a folder"


def unreadable(why: str | None) -> str:
    """Return why a file is skipped whose attributes the system refuses."""
    return f"cannot be read ({why or 'no reason is known'})"


def no_recording() -> str:
    """Return why any other file is skipped."""
    return "no log: it was not there when the run was planned, or belongs to no recording"
