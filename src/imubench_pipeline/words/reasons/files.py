"""Reasons why files of the drop zone belong to no recording."""

STILL_WRITTEN = "still being written: the next run reads it"
ARCHIVE_ATTRIBUTES = "copy of attributes that macOS adds to archives"
DOCUMENTATION = "documentation (.md)"
SETTINGS_BESIDE_SENSORS = "settings beside the folders of the sensors, where they are not read"
LINKED_FOLDER = "link to a folder, which is not followed: link to its files, or copy it"
CLOSED_FOLDER = "folder that cannot be listed"
NEITHER_FILE_NOR_FOLDER = "neither a file nor a folder"
NO_RECORDING = "no log: it was not there when the run was planned, or belongs to no recording"


def editor_backup(name: str) -> str:
    return f"backup of an editor: the name {name!a} ends in ~"


def still_transferred(ending: str) -> str:
    return f"still being transferred, by its ending {ending}"


def hidden(name: str) -> str:
    return f"hidden: the name {name!a} begins with a dot"


def notes_without_log(log: str) -> str:
    return (
        f"notes without a log {log} beside them. Rename them, or add the log. A sensor file "
        "belongs in the folder of the sensor files"
    )


def misnamed_notes(name: str) -> str:
    return f"notes that are not read: rename the file to {name}"


def unreadable(why: str | None) -> str:
    return f"cannot be read ({why or 'no reason is known'})"
