// A response adapter for MoveIt 2: asks the predictor, slows the motion until the liquid keeps the limit, or refuses it.
#include <cmath>
#include <memory>
#include <string>

#include <class_loader/class_loader.hpp>
#include <moveit/planning_interface/planning_response_adapter.hpp>
#include <moveit/planning_scene/planning_scene.hpp>
#include <rclcpp/rclcpp.hpp>
#include <slosh_msgs/srv/predict_slosh.hpp>

namespace slosh_moveit {
using PredictSlosh = slosh_msgs::srv::PredictSlosh;
using moveit_msgs::msg::MoveItErrorCodes;

class LimitSloshing : public planning_interface::PlanningResponseAdapter {
 public:
  void initialize(const rclcpp::Node::SharedPtr& node, const std::string& space) override {
    link_ = node->declare_parameter<std::string>(space + ".container_link", "container");
    limit_ = node->declare_parameter<double>(space + ".height_limit", 0.015);
    residual_ = node->declare_parameter<double>(space + ".residual_limit", 0.0);
    // A node of its own: the one that is given is spun by whoever waits here.
    node_ = std::make_shared<rclcpp::Node>("limit_sloshing");
    client_ = node_->create_client<PredictSlosh>("/slosh/predict");
  }
  std::string getDescription() const override { return "LimitSloshing"; }

  void adapt(const planning_scene::PlanningSceneConstPtr&, const planning_interface::MotionPlanRequest&,
             planning_interface::MotionPlanResponse& res) const override {
    if (!res.trajectory) return;
    auto request = std::make_shared<PredictSlosh::Request>();
    request->limit = limit_;
    request->residual_limit = residual_;
    for (std::size_t i = 0; i < res.trajectory->getWayPointCount(); ++i) {
      const Eigen::Isometry3d& pose = res.trajectory->getWayPointPtr(i)->getGlobalLinkTransform(link_);
      const Eigen::Quaterniond turn(pose.rotation());
      auto& point = request->trajectory.points.emplace_back();
      point.time_from_start = rclcpp::Duration::from_seconds(res.trajectory->getWayPointDurationFromStart(i));
      auto& transform = point.transforms.emplace_back();
      transform.translation.x = pose.translation().x();
      transform.translation.y = pose.translation().y();
      transform.translation.z = pose.translation().z();
      transform.rotation.x = turn.x();
      transform.rotation.y = turn.y();
      transform.rotation.z = turn.z();
      transform.rotation.w = turn.w();
    }
    request->trajectory.joint_names = {link_};
    auto future = client_->async_send_request(request);
    if (rclcpp::spin_until_future_complete(node_, future, std::chrono::seconds(5)) != rclcpp::FutureReturnCode::SUCCESS)
      return refuse(res, "the predictor does not answer");
    const auto answer = future.get();
    if (!answer->success) return refuse(res, answer->message);
    if (answer->excess <= 0.0 && answer->residual_excess <= 0.0) return;
    if (!std::isfinite(answer->time_scale)) return refuse(res, "the liquid exceeds its limit however slow the motion");
    slow(*res.trajectory, answer->time_scale);
  }

 private:
  static void slow(robot_trajectory::RobotTrajectory& trajectory, double scale) {
    for (std::size_t i = 0; i < trajectory.getWayPointCount(); ++i) {
      trajectory.setWayPointDurationFromPrevious(i, scale * trajectory.getWayPointDurationFromPrevious(i));
      auto& state = *trajectory.getWayPointPtr(i);
      for (std::size_t k = 0; k < state.getVariableCount(); ++k) {
        if (state.hasVelocities()) state.setVariableVelocity(k, state.getVariableVelocity(k) / scale);
        if (state.hasAccelerations()) state.setVariableAcceleration(k, state.getVariableAcceleration(k) / (scale * scale));
      }
    }
  }
  void refuse(planning_interface::MotionPlanResponse& res, const std::string& why) const {
    RCLCPP_ERROR(node_->get_logger(), "motion refused: %s", why.c_str());
    res.error_code = moveit::core::MoveItErrorCode(MoveItErrorCodes::INVALID_MOTION_PLAN);
  }

  std::string link_;
  double limit_ = 0.0, residual_ = 0.0;
  rclcpp::Node::SharedPtr node_;
  rclcpp::Client<PredictSlosh>::SharedPtr client_;
};
}  // namespace slosh_moveit

CLASS_LOADER_REGISTER_CLASS(slosh_moveit::LimitSloshing, planning_interface::PlanningResponseAdapter)
