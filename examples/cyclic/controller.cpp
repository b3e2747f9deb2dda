// A controller of the shape of ros2_control's: on_init, on_activate, and update in every cycle, with state and command
// interfaces as plain numbers. It includes no header of ROS, so that it builds here; in a package, the class derives
// from controller_interface::ControllerInterface, and main is the controller manager's. It was not run under ROS.
#include "crane.h"

#include <stdio.h>

enum class Return { OK, ERROR };

class SwayFreeController {
public:
    double *position_state = nullptr, *position_command = nullptr, *velocity_command = nullptr;  // interfaces
    double target = 0.0;                                                                        // of a topic
    bool stop = false;

    void on_init() { crane_init(&state_, &in_); }

    void on_activate()
    {
        in_.bEnable = true;
        in_.fActPosition = *position_state;  // where the axis is taken over
    }

    Return update(double period)
    {
        if (period != in_.fCycleTime) {  // set by crane_init: the block's cycle, which is the controller manager's
            return Return::ERROR;
        }
        in_.bStop = stop;
        in_.bExecute = ready_ && target == in_.fTarget;  // rises in the cycle after the target changed
        in_.fTarget = target;
        if (crane_step(&state_, &in_, &out_)) {
            return Return::ERROR;
        }
        ready_ = ready_ || (out_.bEnabled && !out_.bBusy);
        *position_command = out_.fPosition;
        *velocity_command = out_.fVelocity;
        return out_.bError ? Return::ERROR : Return::OK;
    }

private:
    crane_state state_;
    crane_inputs in_;
    crane_outputs out_;
    bool ready_ = false;
};

int main()
{
    double place = 0.2, command = place, velocity = 0.0;
    SwayFreeController controller;
    controller.position_state = &place;
    controller.position_command = &command;
    controller.velocity_command = &velocity;
    controller.on_init();
    controller.on_activate();
    for (int cycle = 0; cycle < 600; ++cycle) {
        controller.target = cycle < 250 ? 0.7 : 0.4;
        if (controller.update(0.01) != Return::OK) {
            return 1;
        }
        place = command;  // a hardware interface that follows at once
        printf("%a %a\n", command, velocity);
    }
    return 0;
}
