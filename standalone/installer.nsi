; The installer for Windows, from a folder that build.py made:
;     makensis -DFOLDER=dist/gen-profile-windows -DVERSION=0.1.0 -DOUT=dist/gen-profile-setup.exe standalone/installer.nsi
; It is for the user who runs it and asks for no administrator. `gen-profile-setup.exe /S` installs silently.
Target amd64-unicode
ManifestDPIAware true
RequestExecutionLevel user
SetCompressor lzma
Name "gen-profile ${VERSION}"
OutFile "${OUT}"
InstallDir "$LOCALAPPDATA\Programs\gen-profile"
InstallDirRegKey HKCU "Software\gen-profile" "Folder"

!define UNINSTALL "Software\Microsoft\Windows\CurrentVersion\Uninstall\gen-profile"
; Python adds to and takes from PATH, as NSIS cuts texts after 1024 characters
!macro Path Action
    nsExec::Exec '"$INSTDIR\python\python.exe" "$INSTDIR\windows_path.py" ${Action} "$INSTDIR"'
    Pop $0
!macroend

Page directory
Page instfiles
UninstPage uninstConfirm
UninstPage instfiles

!macro Remove  ; what was installed, and nothing else that may lie in the folder
    RMDir /r "$INSTDIR\packages"
    RMDir /r "$INSTDIR\python"
    RMDir /r "$INSTDIR\licences"
!macroend

Section
    !insertmacro Remove  ; an older version's files would lie among the new ones
    SetOutPath "$INSTDIR"
    File /r "${FOLDER}/*"
    File "${__FILEDIR__}/windows_path.py"
    !insertmacro Path add
    CreateShortcut "$SMPROGRAMS\gen-profile studio.lnk" "$INSTDIR\gen-profile.cmd" "studio --preset bay-crane"
    WriteUninstaller "$INSTDIR\uninstall.exe"
    WriteRegStr HKCU "Software\gen-profile" "Folder" "$INSTDIR"
    WriteRegStr HKCU "${UNINSTALL}" "DisplayName" "gen-profile"
    WriteRegStr HKCU "${UNINSTALL}" "DisplayVersion" "${VERSION}"
    WriteRegStr HKCU "${UNINSTALL}" "UninstallString" '"$INSTDIR\uninstall.exe"'
    WriteRegStr HKCU "${UNINSTALL}" "QuietUninstallString" '"$INSTDIR\uninstall.exe" /S'
    WriteRegDWORD HKCU "${UNINSTALL}" "NoModify" 1
    WriteRegDWORD HKCU "${UNINSTALL}" "NoRepair" 1
SectionEnd

Section "Uninstall"
    !insertmacro Path remove
    !insertmacro Remove
    Delete "$INSTDIR\gen-profile.cmd"
    Delete "$INSTDIR\windows_path.py"
    Delete "$INSTDIR\LICENCES.md"
    Delete "$INSTDIR\sbom.cdx.json"
    Delete "$INSTDIR\uninstall.exe"
    RMDir "$INSTDIR"
    Delete "$SMPROGRAMS\gen-profile studio.lnk"
    DeleteRegKey HKCU "${UNINSTALL}"
    DeleteRegKey HKCU "Software\gen-profile"
SectionEnd
