#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>
#include <iostream>
int num = 0;
void hear(const std_msgs::String::ConstPtr& m) { ++num; std::cout << m->data << std::endl; }
bool serve(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& a) { a.success = true; a.message = "from roscpp"; return true; }
int main(int argc, char** argv) {
  ros::init(argc, argv, "talker");
  ros::NodeHandle node;
  ros::Publisher out = node.advertise<std_msgs::String>("/from_roscpp", 10, true);
  ros::Subscriber in = node.subscribe("/to_roscpp", 10, hear);
  ros::ServiceServer service = node.advertiseService("/ask_roscpp", serve);
  std_msgs::String m; m.data = "hello"; out.publish(m);
  ros::ServiceClient client = node.serviceClient<std_srvs::Trigger>("/ask_client");
  while (ros::ok() && num < 1) { ros::spinOnce(); ros::Duration(0.01).sleep(); }
  client.waitForExistence();
  std_srvs::Trigger t; bool ok = client.call(t);
  std::cout << ok << " " << t.response.message << std::endl;
  while (ros::ok() && num < 2) { ros::spinOnce(); ros::Duration(0.01).sleep(); }
}
