// Service calls beside the thread that draws: a server that hangs must freeze neither rviz nor the next call.
#pragma once

#include <ros/ros.h>

#include <chrono>
#include <future>
#include <list>
#include <string>

namespace atmos {

class ServiceCaller {
 public:
  // Calls service `name` on a thread of its own. `what` is how the answer begins ("arm snap").
  template <class Service>
  void call(const std::string& what, const std::string& name, typename Service::Request request) {
    calls_.push_back(std::async(std::launch::async, [what, name, request]() mutable {
      typename Service::Response response;
      if (!ros::service::exists(name, false) || !ros::service::call(name, request, response))
        return what + ": no answer from " + name;
      const std::string result = response.success ? ": done" : ": refused";
      return what + result + (response.message.empty() ? "" : ", " + response.message);
    }));
  }

  // The answer of a call that is over, each once; empty when there is none.
  std::string poll() {
    for (auto call = calls_.begin(); call != calls_.end(); ++call) {
      if (call->wait_for(std::chrono::seconds(0)) != std::future_status::ready) continue;
      const std::string answer = call->get();
      calls_.erase(call);
      return answer;
    }
    return {};
  }

 private:
  std::list<std::future<std::string>> calls_;
};

}  // namespace atmos
