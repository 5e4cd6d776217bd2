// The operator's panel: which robot, arm, disarm, kill, mode, mission, and what the robot says of itself.
#pragma once

#ifndef Q_MOC_RUN
#include <rviz/panel.h>

#include <future>
#include <string>
#include <vector>

#include "robot_listener.h"
#include "service_caller.h"
#endif

class QComboBox;
class QGridLayout;
class QLabel;
class QPushButton;

namespace atmos {

// Widgets are found by their object names (arm, disarm, kill, ...), in tests too.
class OperatorPanel : public rviz::Panel {
  Q_OBJECT
 public:
  explicit OperatorPanel(QWidget* parent = nullptr);

  void onInitialize() override;
  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

 private:
  QPushButton* button(const char* name, const QString& label, const QString& tip);
  void choose(const std::string& robot);
  void tell_tools() const;
  void set_flag(const std::string& what, const std::string& service, bool value);
  void trigger(const std::string& what, const std::string& service);
  void kill_all();
  void set_mode();
  void refresh();
  void refresh_robots();
  void show_robots(const std::vector<std::string>& robots);

  std::string robot_;  // with its slash; empty until one is found
  std::vector<std::string> robots_;
  RobotListener listener_;
  ServiceCaller calls_;
  std::future<std::vector<std::string>> discovery_;

  QComboBox *robot_box_, *mode_box_;
  QPushButton *arm_, *disarm_, *kill_, *kill_all_, *release_kill_, *set_mode_, *start_, *stop_,
      *release_hold_;
  QGridLayout* rows_;
  std::vector<std::pair<QLabel*, QLabel*>> row_labels_;
  QLabel* answer_;
};

}  // namespace atmos
