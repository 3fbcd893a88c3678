// Stand-ins for what an adapter uses of MoveIt, Eigen, class_loader and rclcpp: enough to compile and run it alone.
#pragma once
#include <array>
#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <builtin_interfaces/msg/duration.hpp>

namespace Eigen {
struct Vector3d {
  std::array<double, 3> v{};
  double x() const { return v[0]; }
  double y() const { return v[1]; }
  double z() const { return v[2]; }
};
struct Matrix3d {};
struct Isometry3d {
  Vector3d place;
  Matrix3d rotation() const { return {}; }
  const Vector3d& translation() const { return place; }
};
struct Quaterniond {
  explicit Quaterniond(const Matrix3d&) {}
  double x() const { return 0.0; }
  double y() const { return 0.0; }
  double z() const { return 0.0; }
  double w() const { return 1.0; }
};
}  // namespace Eigen

namespace rclcpp {
struct Logger {};
struct Duration {
  double seconds;
  static Duration from_seconds(double seconds) { return {seconds}; }
  operator builtin_interfaces::msg::Duration() const {
    builtin_interfaces::msg::Duration made;
    made.sec = static_cast<int>(seconds);
    made.nanosec = static_cast<unsigned>((seconds - made.sec) * 1e9 + 0.5);
    return made;
  }
};
enum class FutureReturnCode { SUCCESS, INTERRUPTED, TIMEOUT };
template <class Service>
struct Client {
  using SharedPtr = std::shared_ptr<Client>;
  using Response = std::shared_ptr<typename Service::Response>;
  struct Future {
    Response response;
    Response get() { return response; }
  };
  static std::function<Response(const typename Service::Request&)> answer;
  Future async_send_request(std::shared_ptr<typename Service::Request> request) { return {answer(*request)}; }
};
template <class Service>
std::function<typename Client<Service>::Response(const typename Service::Request&)> Client<Service>::answer;
struct Node {
  using SharedPtr = std::shared_ptr<Node>;
  explicit Node(const std::string&) {}
  template <class T>
  T declare_parameter(const std::string&, const T& value) { return value; }
  template <class Service>
  typename Client<Service>::SharedPtr create_client(const std::string&) { return std::make_shared<Client<Service>>(); }
  Logger get_logger() const { return {}; }
};
template <class Future>
FutureReturnCode spin_until_future_complete(const Node::SharedPtr&, const Future& future, std::chrono::seconds) {
  return future.response ? FutureReturnCode::SUCCESS : FutureReturnCode::TIMEOUT;
}
}  // namespace rclcpp
#define RCLCPP_ERROR(logger, ...) ((void)(logger), std::printf(__VA_ARGS__), std::printf("\n"))
#define CLASS_LOADER_REGISTER_CLASS(Derived, Base) static_assert(std::is_base_of<Base, Derived>::value, "");

namespace moveit_msgs::msg {
struct MoveItErrorCodes {
  static constexpr int SUCCESS = 1, INVALID_MOTION_PLAN = -2;
};
}  // namespace moveit_msgs::msg
namespace moveit::core {
struct MoveItErrorCode {
  int val = moveit_msgs::msg::MoveItErrorCodes::SUCCESS;
  MoveItErrorCode(int code = 1) : val(code) {}
};
struct RobotState {
  Eigen::Isometry3d pose;
  std::vector<double> velocity, acceleration;
  const Eigen::Isometry3d& getGlobalLinkTransform(const std::string&) { return pose; }
  std::size_t getVariableCount() const { return velocity.size(); }
  bool hasVelocities() const { return !velocity.empty(); }
  bool hasAccelerations() const { return !acceleration.empty(); }
  double getVariableVelocity(int k) const { return velocity[k]; }
  double getVariableAcceleration(int k) const { return acceleration[k]; }
  void setVariableVelocity(int k, double value) { velocity[k] = value; }
  void setVariableAcceleration(int k, double value) { acceleration[k] = value; }
};
}  // namespace moveit::core
namespace robot_trajectory {
struct RobotTrajectory {
  std::vector<std::shared_ptr<moveit::core::RobotState>> states;
  std::vector<double> durations;
  std::size_t getWayPointCount() const { return states.size(); }
  std::shared_ptr<moveit::core::RobotState>& getWayPointPtr(std::size_t i) { return states[i]; }
  double getWayPointDurationFromPrevious(std::size_t i) const { return durations[i]; }
  double getWayPointDurationFromStart(std::size_t i) const {
    double sum = 0.0;
    for (std::size_t k = 0; k <= i; ++k) sum += durations[k];
    return sum;
  }
  RobotTrajectory& setWayPointDurationFromPrevious(std::size_t i, double value) {
    durations[i] = value;
    return *this;
  }
};
}  // namespace robot_trajectory
namespace planning_scene {
using PlanningSceneConstPtr = std::shared_ptr<const int>;
}
namespace planning_interface {
struct MotionPlanRequest {};
struct MotionPlanResponse {
  std::shared_ptr<robot_trajectory::RobotTrajectory> trajectory;
  moveit::core::MoveItErrorCode error_code;
};
struct PlanningResponseAdapter {
  virtual ~PlanningResponseAdapter() = default;
  virtual void initialize(const rclcpp::Node::SharedPtr&, const std::string&) {}
  virtual std::string getDescription() const = 0;
  virtual void adapt(const planning_scene::PlanningSceneConstPtr&, const MotionPlanRequest&, MotionPlanResponse&) const = 0;
};
}  // namespace planning_interface
