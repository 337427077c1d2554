"""The front door: what ``import imubench_pipeline as imu`` gives, over the rooms that compute it.

Logs, arrays and tables of users are taken in (`logs`, `given`), handed to what the workflow runs,
and what comes of it is shown in engineers' units, drawn, and given as tables (`curves`,
`estimates`, `comparison`). Nothing is calculated here.
"""
