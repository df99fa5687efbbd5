"""What the keys of `rtc.conf` have when nobody says otherwise, and what a manager says about its host."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Final

__all__ = ["COMPATIBLE_WITH", "DEFAULTS", "host_properties"]

COMPATIBLE_WITH: Final = "2.1.0"
"""The version of OpenRTM-aist whose tools and configuration files are met."""

DEFAULTS: Final[Mapping[str, str]] = {
    "config.version": COMPATIBLE_WITH,
    "openrtm.name": "muros",
    "openrtm.version": COMPATIBLE_WITH,
    "manager.instance_name": "manager",
    "manager.name": "manager",
    "manager.naming_formats": "%h.host_cxt/%n.mgr",
    "manager.modules.load_path": "./",
    "manager.modules.abs_path_allowed": "YES",
    "manager.modules.search_auto": "YES",
    "manager.modules.preload": "",
    "manager.modules.Python.manager_cmd": "muros rtcd",
    "manager.modules.Python.profile_cmd": "muros rtc profile",
    "manager.modules.Python.suffixes": "py",
    "manager.modules.Python.load_paths": "",
    "manager.components.precreate": "",
    "manager.components.preconnect": "",
    "manager.components.preactivation": "",
    "manager.components.naming_policy": "process_unique",
    "manager.is_master": "NO",
    "manager.corba_servant": "YES",
    "manager.shutdown_on_nortcs": "YES",
    "manager.shutdown_auto": "YES",
    "manager.auto_shutdown_duration": "20.0",
    "manager.termination_waittime": "1.0",
    "manager.language": "Python",
    "manager.supported_languages": "C++, Python, Java",
    "manager.local_service.enabled_services": "ALL",
    "manager.cpu_affinity": "",
    "corba.id": "omniORB",
    "corba.args": "-ORBclientCallTimeOutPeriod 10000 -ORBinConScanPeriod 0",
    "corba.endpoints": "all",
    "corba.nameservers": "localhost",
    "corba.master_manager": "localhost:2810",
    "corba.nameservice.replace_endpoint": "NO",
    "corba.update_master_manager.enable": "YES",
    "corba.update_master_manager.interval": "10.0",
    "naming.enable": "YES",
    "naming.type": "corba",
    "naming.formats": "%h.host_cxt/%n.rtc",
    "naming.update.enable": "YES",
    "naming.update.interval": "10.0",
    "naming.update.rebind": "NO",
    "timer.enable": "YES",
    "timer.tick": "0.1",
    "exec_cxt.periodic.type": "PeriodicExecutionContext",
    "exec_cxt.periodic.rate": "1000",
    "exec_cxt.sync_transition": "YES",
    "exec_cxt.transition_timeout": "0.5",
    "logger.enable": "YES",
    "logger.file_name": "./rtc%p.log",
    "logger.date_format": "%b %d %H:%M:%S",
    "logger.log_level": "INFO",
    "logger.stream_lock": "NO",
    "logger.plugins": "",
    "sdo.service.provider.enabled_services": "ALL",
    "sdo.service.consumer.enabled_services": "ALL",
}
"""As OpenRTM-aist has them, but for what names the program itself."""


def host_properties() -> dict[str, str]:
    """What components and managers say about the host and the process they run in."""
    system = os.uname()
    return {
        "manager.pid": str(os.getpid()),
        "os.name": system.sysname,
        "os.release": system.release,
        "os.version": system.version,
        "os.arch": system.machine,
        "os.hostname": system.nodename,
    }
