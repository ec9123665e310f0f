// Stand-in for the header of the same name: what docs/controllers.md uses of rclcpp (Jazzy). Its clock stands still.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

enum rcl_clock_type_t { RCL_SYSTEM_TIME = 1, RCL_ROS_TIME = 2 };

namespace rclcpp {
struct Duration {
  int64_t value;
  double seconds() const { return 1e-9 * static_cast<double>(value); }
};

class Time {
public:
  Time(int64_t nanoseconds = 0, rcl_clock_type_t type = RCL_SYSTEM_TIME) : value_(nanoseconds), type_(type) {}

  template <typename Stamp, typename = decltype(Stamp::nanosec)>
  Time(const Stamp & stamp, rcl_clock_type_t type = RCL_ROS_TIME)
  : value_(1000000000 * static_cast<int64_t>(stamp.sec) + stamp.nanosec), type_(type) {}

  int64_t nanoseconds() const { return value_; }

  Duration operator-(const Time & other) const {
    if (type_ != other.type_) throw std::runtime_error("can't subtract times with different time sources");
    return {value_ - other.value_};
  }

private:
  int64_t value_;
  rcl_clock_type_t type_;
};

class Clock {
public:
  using SharedPtr = std::shared_ptr<Clock>;
  Time now() const { return {time, type}; }
  rcl_clock_type_t get_clock_type() const { return type; }
  int64_t time = 0;
  rcl_clock_type_t type = RCL_ROS_TIME;
};

template <typename Message> struct Subscription {
  using SharedPtr = std::shared_ptr<Subscription>;
  std::string topic;
  std::function<void(const Message &)> take;
};

class Node {
public:
  Clock::SharedPtr get_clock() { return clock_; }

  template <typename Message, typename Callback>
  typename Subscription<Message>::SharedPtr create_subscription(const std::string & topic, int, Callback && take) {
    auto made = std::make_shared<Subscription<Message>>(Subscription<Message>{topic, take});
    newest = made;
    return made;
  }

  std::weak_ptr<void> newest;

private:
  Clock::SharedPtr clock_ = std::make_shared<Clock>();
};
}
