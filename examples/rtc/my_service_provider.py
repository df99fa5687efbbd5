"""Provides SimpleService::MyService: it repeats what it is told, and remembers.

muros rtc run my_service_provider.py
muros rtc run my_service_consumer.py
rtcon MyServiceProvider0.rtc:MyService MyServiceConsumer0.rtc:MyService
rtact MyServiceProvider0.rtc MyServiceConsumer0.rtc
"""

from muros.rtc import Component, Provided, run


class MyService:
    """The operations of the interface, as MyService.idl has them."""

    def __init__(self, component: Component) -> None:
        self._said: list[str] = []
        self._values: list[float] = []

    def echo(self, msg: str) -> str:
        print(f"echo: {msg}", flush=True)
        self._said.append(msg)
        return msg

    def get_echo_history(self) -> list[str]:
        return self._said

    def set_value(self, value: float) -> None:
        self._values.append(value)

    def get_value(self) -> float:
        return self._values[-1] if self._values else 0.0

    def get_value_history(self) -> list[float]:
        return self._values


class MyServiceProvider(Component):
    """MyService Provider Sample component"""

    version = "1.0"
    category = "example"
    max_instance = 10

    service = Provided(
        "SimpleService::MyService", idl="MyService.idl", by=MyService, port="MyService", instance="myservice0"
    )


if __name__ == "__main__":
    run(MyServiceProvider)
