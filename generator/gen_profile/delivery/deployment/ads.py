"""A playback block in a TwinCAT controller, reached by ADS through the names of its arrays.

ADS has no security of its own: the controller admits computers to which it has a route, by their address.
"""

import ctypes
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

import numpy as np
import pyads
from pyads.constants import ADSIGRP_SYM_VALBYHND

from gen_profile.delivery.deployment.mailbox import UNSECURED, LinkLostError, first_connected
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.motion.profile import Array
from gen_profile.support.errors import DeploymentError
from gen_profile_exporters.playback.buffers import LENGTH, REPLY, REQUEST, STATE, state_length

TIMEOUT = 4000  # ms of a single request
WRAPPED = ".fbMotion"  # the block's instance in a wrapper
NO_SYMBOL, OLD_SYMBOL = 0x710, 0x711  # error codes of ADS devices: a name, or a handle, that is not known
DEVICE_ERRORS = range(0x700, 0x740)  # what the controller has decided; all others are the connection's

Given = TypeVar("Given")


class AdsLink:
    """A connection to one instance of a block.

    Parameters
    ----------
    url : str
        As it was asked for.
    place : (str, int, str)
        AMS NetId, six numbers; AMS port of the PLC's runtime, 851 for the first one; and its address, with
        ``:PORT`` if that is not the protocol's.
    instance : str
        Path of the block's instance, such as ``MAIN.fbMotion``; empty to find it.
    table : BlockTable
        What is to be in the controller.

    Raises
    ------
    DeploymentError
        The controller cannot be reached, or refuses, or shows no block, or several.
    """

    def __init__(self, url: str, place: tuple[str, int, str], instance: str, table: BlockTable) -> None:
        self._url, self._handles = url, dict[str, int]()
        self._lengths = {REQUEST: LENGTH, REPLY: LENGTH, STATE: state_length(table.constant("cAxes"))}
        self._connection = pyads.Connection(*place)
        self.server = {"url": url}
        look_at = "the address and the NetId, whether the controller has a route to this computer, and at the"
        with first_connected(self, url, f"{look_at} network"):
            self._connect()
            self._instance = self._found(instance)
            self._take_handles()
        self.server |= {"instance": self._instance, **UNSECURED}

    def close(self) -> None:
        """End the connection, if it stands."""
        with suppress(LinkLostError, DeploymentError):
            self._run(self._connection.close)

    def write(self, request: Array) -> None:
        """Write the whole request, in one telegram."""
        handle, kind = self._handles[REQUEST], ctypes.c_double * LENGTH
        self._run(lambda: self._connection.write(ADSIGRP_SYM_VALBYHND, handle, request.tolist(), kind))

    def read(self) -> Array:
        """Read the whole reply."""
        return self._doubles(REPLY)

    def state(self) -> Array:
        """Read the whole of what the block shows of itself."""
        return self._doubles(STATE)

    def reopen(self) -> None:
        """Connect again."""
        self.close()
        self._connect()
        self._take_handles()

    def _connect(self) -> None:
        self._run(self._connection.open)
        self._connection.set_timeout(TIMEOUT)

    def _take_handles(self) -> None:
        for name in self._lengths:
            handle = self._handle(f"{self._instance}.{name}")
            if handle is None:
                raise LinkLostError(f"{self._instance}.{name} is not there any more")
            self._handles[name] = handle

    def _found(self, asked: str) -> str:
        """Find the one instance that was named, or that there is."""
        named = [asked] if asked else self._run(self._structures)
        fitting = [
            path
            for name in named
            for path in (name, name + WRAPPED)
            if all(self._handle(f"{path}.{array}") is not None for array in self._lengths)
        ]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            raise DeploymentError(
                f"{self._url} shows several ({', '.join(fitting)}); name one as the instance."
            )
        raise DeploymentError(
            f"{self._url} shows no block with {REQUEST} and {REPLY}"
            + (f" as {asked}" if asked else "")
            + ': load one that was exported with export.plc_tables = "variables", and name its instance, '
            "such as MAIN.fbCrane.fbMotion, if it lies in other blocks."
        )

    def _structures(self) -> list[str]:
        """List the global variables, and those of programs, that are of no elementary type."""
        return [one.name for one in self._connection.get_all_symbols() if one.plc_type is None]

    def _handle(self, name: str) -> int | None:
        def taken() -> int | None:
            try:
                return int(self._connection.get_handle(name))
            except pyads.ADSError as error:
                if error.err_code == NO_SYMBOL:
                    return None
                raise

        return self._run(taken)

    def _doubles(self, name: str) -> Array:
        handle, kind = self._handles[name], ctypes.c_double * self._lengths[name]
        try:
            values = self._run(lambda: self._connection.read(ADSIGRP_SYM_VALBYHND, handle, kind))
        except RuntimeError as error:  # of pyads, about the length
            raise DeploymentError(
                f"{self._instance}.{name} is no array of {self._lengths[name]} LREAL there: the block is of "
                "another version, or for other axes. Export it again, and load it into the controller."
            ) from error
        return np.array(values, dtype=np.float64)

    def _run(self, work: Callable[[], Given]) -> Given:
        try:
            with _muted():
                return work()
        except pyads.ADSError as error:
            words = error.msg.strip(" .")
            if error.err_code in DEVICE_ERRORS and error.err_code not in {NO_SYMBOL, OLD_SYMBOL}:
                raise DeploymentError(
                    f"The controller refuses ({words}); look whether its program runs, and at {REQUEST}, "
                    f"{REPLY} and {STATE} of the block."
                ) from error
            raise LinkLostError(words) from error


@contextmanager
def _muted() -> Iterator[None]:
    """Keep what the library writes about lost connections off the terminal."""
    shown, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(shown, 2)
        os.close(shown)
        os.close(nothing)
