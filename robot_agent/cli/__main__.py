"""`python -m robot_agent.cli`"""

from robot_agent.cli import main

main()
