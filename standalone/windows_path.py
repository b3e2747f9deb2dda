"""Add a folder to the user's PATH in Windows, or remove it: `python windows_path.py add|remove FOLDER`."""

import ctypes
import sys
import winreg


def main(action: str, folder: str) -> None:
    """Do so, and have programs that start from now on see it."""
    with winreg.OpenKey(winreg.HKEY_CURRENT_USER, "Environment", access=winreg.KEY_ALL_ACCESS) as key:
        try:
            before, kind = winreg.QueryValueEx(key, "Path")
        except FileNotFoundError:
            before, kind = "", winreg.REG_EXPAND_SZ
        others = [part for part in before.split(";") if part and part.casefold() != folder.casefold()]
        winreg.SetValueEx(key, "Path", 0, kind, ";".join([*others, folder] if action == "add" else others))
    everyone, settings_changed, unless_it_hangs, wait = 0xFFFF, 0x1A, 2, 1000
    tell = ctypes.windll.user32.SendMessageTimeoutW
    tell(everyone, settings_changed, 0, "Environment", unless_it_hangs, wait, None)


if __name__ == "__main__":
    main(*sys.argv[1:])
