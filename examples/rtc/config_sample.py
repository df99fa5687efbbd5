"""Parameters of all kinds, printed when they change.

muros rtc run config_sample.py -f config_sample.conf
rtact ConfigSample0.rtc
rtconf ConfigSample0.rtc set int_param0 7
rtconf ConfigSample0.rtc act mode1
"""

from muros.rtc import Component, ConfigEvent, Parameter, ReturnCode, run


class ConfigSample(Component):
    """Configuration example component"""

    version = "1.0"
    category = "example"
    max_instance = 10
    rate = 10

    int_param0 = Parameter(0, widget="slider.10", constraint="0<=x<=150")
    int_param1 = Parameter(1, widget="spin", constraint="0<=x<=1000")
    double_param0 = Parameter(0.11, widget="slider.0.1", constraint="0<=x<=100")
    double_param1 = Parameter(9.9, widget="text")
    str_param0 = Parameter("hoge", widget="radio", constraint="(default,mode0,mode1,foo,bar,radio)")
    str_param1 = Parameter("dara", widget="text")
    vector_param0 = Parameter([0.0, 1.0, 2.0, 3.0, 4.0], widget="text")

    def on_initialize(self) -> ReturnCode:
        self.configuration.listeners.add(ConfigEvent.ACTIVATE_CONFIG_SET, self.show_set)
        self.shown: list[object] = []
        return ReturnCode.RTC_OK

    def on_execute(self, context: int) -> None:
        values: list[object] = [
            *(self.int_param0, self.int_param1, self.double_param0, self.double_param1),
            *(self.str_param0, self.str_param1, self.vector_param0),
        ]
        if values != self.shown:
            self.shown = values
            print(*values, sep=" | ", flush=True)

    def show_set(self, name: str) -> None:
        """Called when somebody activates a configuration set."""
        print(f"set {name} is active now", flush=True)


if __name__ == "__main__":
    run(ConfigSample)
