"""Calls SimpleService::MyService of whoever provides it, once in each cycle."""

from muros.rtc import Component, NotConnectedError, PeerLostError, Required, run


class MyServiceConsumer(Component):
    """MyService Consumer Sample component"""

    version = "1.0"
    category = "example"
    max_instance = 10
    rate = 1

    service = Required(
        "SimpleService::MyService", idl="MyService.idl", port="MyService", instance="myservice0"
    )

    def on_activated(self, context: int) -> None:
        self.count = 0

    def on_execute(self, context: int) -> None:
        try:
            print(self.service.echo(f"hello {self.count}"), flush=True)
            self.service.set_value(float(self.count))
        except (NotConnectedError, PeerLostError) as error:  # nobody provides it, or not at this moment
            print(error, flush=True)
        self.count += 1


if __name__ == "__main__":
    run(MyServiceConsumer)
